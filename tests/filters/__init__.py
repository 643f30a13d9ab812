"""Recursions and mixtures by themselves."""
