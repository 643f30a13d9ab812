"""Cameras, boxes, projection, and what the boxes of several cameras say of each other."""
