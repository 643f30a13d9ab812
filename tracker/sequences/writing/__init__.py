"""Changing a sequence that is there: teaching it, and saving it with its comments."""
