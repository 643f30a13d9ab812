"""Kernels of the labelled fusion: a step, a camera, its association marginals."""
