"""Kernels over the components of an intensity, for the PHD recursions."""
