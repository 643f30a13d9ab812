"""Kernels of the labelled fusion: a step, the update by a camera, its association marginals."""
