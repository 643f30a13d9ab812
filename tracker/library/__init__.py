"""The library of runs: one SQLite file with recordings, runs, their tracks and figures."""

KEEP = 1000
"""Most runs without star, name, note or tag that are kept, unless ``--keep`` says otherwise."""
