"""Short clips made for one claim each, with their truth."""
