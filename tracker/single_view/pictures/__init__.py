"""What is found in pictures: colours, what is not the background and its pieces, sets of boxes."""
