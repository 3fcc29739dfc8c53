"""Recordings of force/torque sensors: reading CSV, Parquet, NPZ, LeRobot files and ROS bags, units, and averaging."""
