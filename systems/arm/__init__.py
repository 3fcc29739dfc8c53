"""An arm that carries the peg: its bodies and drives, and the motion of its tip."""
