"""Studies as the page sees them."""
