"""What the program writes."""
