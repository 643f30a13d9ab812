"""What people do with the page: see, tune, select, teach, share."""
