"""Is a recording as it should be: what is odd in sentences, each with what mends it."""
