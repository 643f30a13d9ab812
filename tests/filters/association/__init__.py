"""Association probabilities and joint events."""
