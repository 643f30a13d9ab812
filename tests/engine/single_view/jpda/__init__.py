"""Joint probabilistic data association."""
