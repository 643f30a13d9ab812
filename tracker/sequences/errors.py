"""The error of a sequence that cannot be read."""

from __future__ import annotations

from tracker.files.text import visible


class SequenceError(ValueError):
    """A sequence cannot be read; the message names file and field, expected and found."""

    def __init__(self, message: str) -> None:
        super().__init__(visible(message))
