"""Rotations and noise, shared by the other rooms."""
