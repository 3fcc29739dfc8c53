"""Transformers of the measured wrench and depth into features."""
