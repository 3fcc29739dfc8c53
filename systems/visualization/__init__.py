"""Draws the scene and the estimated contact state into Meshcat."""
