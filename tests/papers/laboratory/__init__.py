"""What experiments share: runs, processes, drawing, writing."""
