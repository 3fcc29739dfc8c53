"""The scoreboard of a sweep: statistics, tables, curves and their page. Nothing in here imports Drake."""
