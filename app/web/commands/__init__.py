"""What a person edits, as typed commands: one address takes them all, by their names."""
