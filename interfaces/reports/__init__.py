"""Replay pages, batch pages and terminal output. Nothing in here imports Drake."""
