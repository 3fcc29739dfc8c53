"""The skill against other policies on the rig."""
