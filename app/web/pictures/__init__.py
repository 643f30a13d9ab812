"""Pictures on the wire: frames, and what a method sees in them."""
