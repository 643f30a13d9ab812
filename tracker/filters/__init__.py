"""Recursions over sets of targets: GM-PHD and Poisson multi-Bernoulli, and their models."""
