"""The compiled kernels of the hot loops, plain functions of arrays, by numba."""
