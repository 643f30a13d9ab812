"""The queue, self-consistency and template suggestions."""
