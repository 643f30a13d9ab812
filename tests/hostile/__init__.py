"""What somebody hostile sends: garbage over the API and both sockets, and more than is meant."""
