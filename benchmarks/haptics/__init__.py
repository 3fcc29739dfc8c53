"""The live session in a real browser."""
