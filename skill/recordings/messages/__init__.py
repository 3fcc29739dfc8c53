"""Readers of recorded messages: MCAP files and the SQLite files of rosbag2."""
