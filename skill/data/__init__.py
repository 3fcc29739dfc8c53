"""Demonstrations, rig runs and their files; outcomes, geometry and the refinement of demonstrations."""
