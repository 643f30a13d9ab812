"""Tests of the checks of a recording."""
