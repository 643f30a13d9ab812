"""What the page talks to: the server, its routes and its sockets."""
