"""Metrics of edited scenes, one a file: its columns in tables, and the function that measures."""
