"""Tracks against the truth, as the page asks for them."""
