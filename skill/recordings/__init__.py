"""Recordings of force/torque sensors: reading CSV, Parquet, NPZ, MCAP and LeRobot files, units, and averaging."""
