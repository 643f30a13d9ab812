"""Whole runs, what is kept of them, their parameters."""
