"""Drake multibody plants of the peg, the hole and the rig."""
