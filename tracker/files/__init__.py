"""The writing of files, the user's folders, and the validation of stored JSON."""
