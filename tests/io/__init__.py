"""Formats, import and check."""
