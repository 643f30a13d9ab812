"""Stage 1: what each camera sees by itself. One protocol, one file a method."""
