"""viser's panel of sliders, made from the parameters' definitions."""
