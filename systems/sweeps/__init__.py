"""Sweeps: many trials over scenarios, policies, arms and engines, into a Parquet data set."""
