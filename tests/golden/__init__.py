"""Every stage of every method on short pieces of every recording, against what it gave before.

``pytest tests/golden`` compares sums with those in ``expected/``, to one part in a million:
enough to see another order of the arithmetic that matters, too little for the last bits in
which processors differ. ``pytest tests/golden --update-golden`` (with ``--long`` for the longer
form too) accepts what is found now and prints what changed; commit the files with the change
that caused it and say why in its message.

``python -m tests.golden --exact FILE`` and ``--compare FILE`` do the same bit for bit, for a
change that must change no number at all.
"""
