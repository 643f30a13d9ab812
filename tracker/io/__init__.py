"""The import of recordings of other programs: formats, conventions, import and checks."""
