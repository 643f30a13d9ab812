"""Who can use the page: by keys alone, with a reader, at any size, dark and light."""
