"""Recordings of force/torque sensors: reading them from CSV, Parquet, NPZ, MCAP and LeRobot files, and averaging them."""
