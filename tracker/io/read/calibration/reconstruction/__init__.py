"""Cameras as programs that reconstruct a scene from its pictures write them."""
