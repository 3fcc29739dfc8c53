"""Locally weighted regression and how its bandwidth is chosen."""
