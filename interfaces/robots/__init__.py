"""Arms that people have, by their own protocols."""
