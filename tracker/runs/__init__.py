"""A run: its stages, and the cache of their results in memory and on disk."""
