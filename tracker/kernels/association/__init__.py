"""Kernels of data association: matchings, sums over subsets, belief propagation."""
