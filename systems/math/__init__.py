"""Rotations and noise, used by the other subpackages."""
