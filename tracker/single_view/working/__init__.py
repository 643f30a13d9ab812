"""The images of stage 1: reduced to the resolution that it needs, upright, and stabilised."""
