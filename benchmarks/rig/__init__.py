"""Comparisons of the learnt skill with other policies on the rig."""
