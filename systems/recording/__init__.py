"""Recorders of demonstrations and rig runs."""
