"""Thin command-line shells, one a task."""
