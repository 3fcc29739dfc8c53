"""What moves: one LeafSystem a file, and the two diagrams built from them."""
