"""Tracks in the forms of other programs."""
