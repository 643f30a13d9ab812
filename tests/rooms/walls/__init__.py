"""What a rendered room is made of: surfaces, furniture, paint."""
