"""The claims of the papers: one module each, whose ``EXPERIMENT`` says what is run."""
