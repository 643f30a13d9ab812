"""The pictures of a sequence: their files, their decoding, and missing files."""
