"""Tests of the smoothing."""
