"""Corrections and the queue of doubtful places over HTTP."""
