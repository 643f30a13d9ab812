"""Cameras as structure from motion writes them: scale and up are arbitrary."""
