"""Figures of demonstrations, runs, states and practice."""
