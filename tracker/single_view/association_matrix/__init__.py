"""Foreground objects by association matrices, Chang, Ma & Qiao 2007."""
