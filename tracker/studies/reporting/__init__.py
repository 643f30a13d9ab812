"""The presentation of a study: a summary, commands, and reports."""
