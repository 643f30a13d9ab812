"""Whether boxes of several cameras meet in 3D: what they tell of calibration, room and people."""
