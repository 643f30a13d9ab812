"""Who is who in 3D: labels that come back, of the same person and of one person alone."""
