"""Comparisons of the simulated contact with theory, finer discretisations and MuJoCo."""
