"""The contact plants: peg, hole and rig as Drake multibody plants."""
