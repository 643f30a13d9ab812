"""An evaluation as one HTML file that needs no other."""
