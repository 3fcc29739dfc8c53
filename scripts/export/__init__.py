"""Command lines that write recordings for other programs, and read them back."""
