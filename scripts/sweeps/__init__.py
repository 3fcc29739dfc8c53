"""Command lines for sweeps."""
