"""What Meshcat shows while a diagram runs."""
