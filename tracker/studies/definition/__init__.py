"""The definition of a study: its file, objectives, varied parameters and their space."""
