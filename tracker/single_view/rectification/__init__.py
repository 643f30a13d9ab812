"""The images of stage 1: reduced to the resolution that it needs, upright, and stabilised.

A camera is rectified by itself, against its roll; this is not the rectification of a stereo pair.
"""
