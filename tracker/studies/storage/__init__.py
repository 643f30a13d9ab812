"""The storage of a study: its folder, records and results."""
