"""Templates that a run's tracks offer."""
