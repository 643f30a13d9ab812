"""Cameras as motion capture systems export them."""
