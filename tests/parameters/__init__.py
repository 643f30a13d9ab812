"""Tests of runs: what is kept of them, and the processes that compute them."""
