"""Videos and folders of pictures."""
