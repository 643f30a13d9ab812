"""The 3D view: its drawing by viser, and its editing."""
