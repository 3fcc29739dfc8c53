"""Recordings and runs in the formats of other programs, and back: data sets of LeRobot, logs in MCAP; without Drake."""
