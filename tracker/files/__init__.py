"""How files are written, where the user's folders are, and how stored JSON is validated."""
