"""Where people really were, as data sets give it."""
