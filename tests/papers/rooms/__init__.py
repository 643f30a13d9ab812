"""Every method on random rooms: how often it fails, and what was in the rooms where it does."""
