"""Arguments of commands that belong together."""
