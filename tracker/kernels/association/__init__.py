"""Kernels of the association: matchings, sums over subsets, belief propagation."""
