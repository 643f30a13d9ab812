"""From files of whatever kind to a sequence folder: gathered, matched, settled, written."""
