"""Bringing files of others in: uploaded or found on the disk, looked into, written."""
