"""The review of runs by a person: the queue of items, self-consistency, and suggested templates."""
