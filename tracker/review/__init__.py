"""What a person should review: the queue of items, self-consistency, and template suggestions."""
