"""The pictures of a sequence: the files, what decodes them, which of the row are there."""
