"""Identity without truth."""
