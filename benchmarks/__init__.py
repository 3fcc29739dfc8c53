"""Comparisons with contact theory, other learners and other controllers."""
