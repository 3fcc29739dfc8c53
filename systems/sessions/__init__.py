"""Whole sessions of work into a folder: recording, rig trials, practice; continued after an interruption."""
