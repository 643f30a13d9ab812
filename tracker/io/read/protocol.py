"""What a format is: a module (or any object) that recognises its files and reads them."""

from __future__ import annotations

from collections.abc import Iterable
from enum import IntEnum
from typing import Literal, Protocol

from tracker.io.read.pieces import Piece
from tracker.io.read.source import SourceFile

Kind = Literal["calibration", "detections", "truth", "pictures", "time"]


class Certainty(IntEnum):
    """How sure a format is that a file is its own. The surest format reads the file."""

    NO = 0
    POSSIBLE = 1
    """The content could be of this format, and of others."""
    LIKELY = 2
    """The content has what is typical of the format."""
    SURE = 3
    """The content says so itself."""


class Format(Protocol):
    """One format. A laboratory adds its own by the entry point group ``multiview_phd.formats``."""

    NAME: str
    """As it is shown: the program that writes it, and the kind of file."""
    KIND: Kind
    SERIES: bool
    """Whether one recording is a series of numbered files, which are read together."""

    def recognise(self, file: SourceFile) -> Certainty:
        """Look at the content (``file.head``), never at the name alone. Must be quick.

        Raises:
            FormatError: If it cannot be what it begins to be; the next format is asked then.
        """
        ...

    def read(self, file: SourceFile) -> Iterable[Piece]:
        """All pieces of the file, or of the series that it stands for.

        Raises:
            FormatError: In one sentence: file and field, expected, found, what to do.
        """
        ...
