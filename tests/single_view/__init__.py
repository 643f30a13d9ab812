"""Stage 1, method by method."""
