"""The pictures that stage 1 works on: reduced to what it needs, and turned upright."""
