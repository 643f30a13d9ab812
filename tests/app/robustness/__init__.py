"""Connections that only cost, calls in any order, a soak, no home, a clock that goes back."""
