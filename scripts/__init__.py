"""Command lines, one per task; `haptic-skill` is all of them in one command."""
