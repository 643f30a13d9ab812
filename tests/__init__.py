"""The tests. ``python3 -m tests`` sets up everything they need and runs them."""
