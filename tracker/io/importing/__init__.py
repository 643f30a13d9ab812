"""The import of foreign files as a sequence folder: gathered, matched, interpreted and written."""
