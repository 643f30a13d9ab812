"""Stage 2: laws, methods, its parts."""
