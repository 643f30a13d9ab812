"""The formats of other programs, whose files are read into pieces of a sequence."""
