"""Measurements of the clients of sensors."""
