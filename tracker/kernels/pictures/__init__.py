"""Kernels over pixels and boxes of one image."""
