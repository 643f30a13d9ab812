"""A run as an MP4: the cameras with boxes, labels and trails, the room from above, the lanes."""
