"""Stage 2: the boxes of all cameras into one 3D posterior. One protocol, one file a method."""
