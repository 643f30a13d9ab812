"""What other programs write, read into pieces that become a sequence folder."""
