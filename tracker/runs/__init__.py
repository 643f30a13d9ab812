"""A run: its stages, what is kept of each, in memory and on disk."""
