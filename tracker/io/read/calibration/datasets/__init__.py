"""Cameras as published recordings give them."""
