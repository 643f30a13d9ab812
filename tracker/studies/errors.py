"""What goes wrong with a study, in a sentence."""

from __future__ import annotations


class StudyError(ValueError):
    """A study cannot be read, run or gone on with; the message says why and what to do."""
