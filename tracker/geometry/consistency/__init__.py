"""Multi-view consistency of boxes: evidence for calibration, room, time offsets and people."""
