"""What is kept of runs: one SQLite file with recordings, runs, their tracks and figures."""

KEEP = 1000
"""Runs that nobody has starred, named, noted or tagged, kept unless ``--keep`` says otherwise."""
