"""The 3D view: what viser draws, and what a person changes in it."""
