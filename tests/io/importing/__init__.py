"""Importing recordings: gathered, settled, written as a sequence folder."""
