"""What the colour methods share: templates, likelihood and its peaks."""
