"""What the manual prints of runs: made once, kept as JSON."""
