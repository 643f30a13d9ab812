"""Tests of :mod:`tracker.files`."""
