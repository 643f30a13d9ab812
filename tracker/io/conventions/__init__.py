"""How files are meant: every interpretation judged by one likelihood, decided, open or none."""
