"""What is read off a picture: colours, foreground, outlines."""
