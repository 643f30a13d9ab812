"""Recorded multi-view sequences: the folder format, its pictures, and the built-in recordings."""
