"""Cameras, boxes and assignments."""
