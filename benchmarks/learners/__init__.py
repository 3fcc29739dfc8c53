"""The learners against other learners."""
