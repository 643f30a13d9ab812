"""Detection of people by shape: edges, background difference and motion, with boosted trees."""
