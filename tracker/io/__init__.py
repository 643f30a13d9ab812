"""How a foreign recording becomes a sequence: formats, conventions, import, check."""
