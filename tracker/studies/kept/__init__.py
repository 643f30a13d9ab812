"""A study on disk: its folder, what is written down, and the writing."""
