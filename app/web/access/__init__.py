"""Who gets in, and what a connection may cost."""
