"""What each command does, a file each; the line itself is read in the room above."""
