"""The hot loops, compiled by numba: plain functions of arrays."""
