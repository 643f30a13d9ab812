"""The analysis of a study: importance of parameters, and the proposal of values."""
