"""The server of the page: its routes, sockets and access control."""
