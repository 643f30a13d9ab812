"""The error of a study."""

from __future__ import annotations

from tracker.files.text import visible


class StudyError(ValueError):
    """A study cannot be read, run or resumed; the message says why, and what the user can do."""

    def __init__(self, message: str) -> None:
        super().__init__(visible(message))
