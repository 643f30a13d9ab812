"""The changes of a sequence by the user: room, target and templates, and saving them."""
