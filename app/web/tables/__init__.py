"""Tables as the page shows them, in HTML and for other programs."""
