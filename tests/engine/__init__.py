"""Tests of the engine by itself: no pictures, no server."""
