"""Who plays in a rendered room: bodies, gait, paths, doors."""
