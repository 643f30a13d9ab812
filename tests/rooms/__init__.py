"""The generator of rooms, and the built-in sequences that are made with it."""
