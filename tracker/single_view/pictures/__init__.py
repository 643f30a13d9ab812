"""Image processing: colour histograms, foreground and its components, and sets of boxes."""
