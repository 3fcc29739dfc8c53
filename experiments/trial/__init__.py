"""One trial of the rig: its draws, its simulation by loop or diagram, its figures, its result."""
