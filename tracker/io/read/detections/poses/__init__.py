"""Boxes out of the joints of poses."""
