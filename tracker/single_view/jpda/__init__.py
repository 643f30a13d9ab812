"""Tracking in one camera by joint probabilistic data association, with five cases."""
