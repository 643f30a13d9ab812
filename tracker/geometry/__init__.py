"""Cameras, boxes, projection, and the consistency of boxes of several cameras."""
