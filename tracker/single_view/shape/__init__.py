"""People by their shape: edges, what is not background and what moved, weighed by boosted trees."""
