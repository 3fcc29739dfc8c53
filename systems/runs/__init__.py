"""Demonstrations, rig trials and practice: simulation, outcome and results."""
