"""Comparisons of this project's learners with other learners."""
