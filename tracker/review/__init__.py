"""What a person should look at: the queue, self-consistency, template suggestions."""
