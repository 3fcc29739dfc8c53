"""Figures of demonstrations, rig runs, practice and state graphs."""
