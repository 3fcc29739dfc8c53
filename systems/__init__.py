"""Drake systems of the virtual environment and of the rig, and the two diagrams built from them."""
