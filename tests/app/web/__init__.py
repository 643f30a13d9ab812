"""Routes, sockets and what they send."""
