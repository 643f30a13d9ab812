"""Kernels of the smoothing: information of boxes on paths, smoothing passes, and association."""
