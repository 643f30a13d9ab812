"""What is found out of the files of an import: whose is what, how it is meant, when it was."""
