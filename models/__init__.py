"""Geometry, materials, hardware presets and scenarios. Imports no other package of this project."""
