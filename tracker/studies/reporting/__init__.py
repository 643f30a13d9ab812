"""A study as it is told: in words, as commands, as a report."""
