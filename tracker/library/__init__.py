"""The library of runs: one SQLite file with recordings, runs, their tracks and figures."""

KEEP = 1000
"""Default of ``--keep``: the largest number of runs without star, name, note or tag that are
kept: 0.2 GB of runs of 500 steps and 10 people."""
