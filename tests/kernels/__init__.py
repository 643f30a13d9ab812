"""Compiled kernels against plain NumPy, and how they are compiled."""
