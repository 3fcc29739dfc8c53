"""Demonstrations and rig runs on disk, and their refinement."""
