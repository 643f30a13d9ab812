"""Kernels of the smoothing: what boxes say of paths, their best states, and who made which box."""
