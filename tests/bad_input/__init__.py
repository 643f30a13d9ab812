"""Bad input: every kind of file with every damage, from one table, and at random."""
