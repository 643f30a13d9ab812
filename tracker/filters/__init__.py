"""Recursions over sets of targets: GM-PHD, Poisson multi-Bernoulli, their models, association."""
