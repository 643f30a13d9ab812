"""The pseudo particle filter, Sun & Guo 2008."""
