"""Tracks against the truth in the workbench: the command, the worker, the routes."""
