"""A run as messages: its steps, its timeline, its results."""
