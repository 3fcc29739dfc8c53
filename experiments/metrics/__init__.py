"""Figures of a simulated run: forces, motion, overlap, jams and wedges."""
