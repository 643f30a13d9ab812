"""The interpretation of files: poses, axes, units and boxes, compared by one likelihood."""
