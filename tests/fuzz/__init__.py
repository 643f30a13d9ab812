"""Damage of every kind, at random and from a corpus of what fell: a sentence, never a crash."""
