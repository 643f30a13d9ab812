"""How files are written, where they lie, and how what was written is validated."""
