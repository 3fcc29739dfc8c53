"""Locally weighted regression, and the selection of its parameters."""
