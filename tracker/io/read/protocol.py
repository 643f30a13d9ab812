"""The protocol of formats: a format is a module, or an object, that recognises and reads files."""

from __future__ import annotations

from collections.abc import Iterable
from enum import IntEnum
from typing import Literal, Protocol

from tracker.io.read.pieces import Piece
from tracker.io.read.source import SourceFile

Kind = Literal["calibration", "detections", "truth", "pictures", "time"]


class Certainty(IntEnum):
    """How certain it is that a file has a format. The most certain format reads the file."""

    NO = 0
    POSSIBLE = 1
    """The content may be of this format, or of others."""
    LIKELY = 2
    """The content is typical of the format."""
    SURE = 3
    """The content states the format."""


class Format(Protocol):
    """One format. Plugins add formats by the entry point group ``multiview_phd.formats``."""

    @property
    def NAME(self) -> str:
        """The name for display: the program that writes the format, and the kind of file."""
        ...

    @property
    def KIND(self) -> Kind:
        """What the files hold."""
        ...

    @property
    def SERIES(self) -> bool:
        """Whether a recording may be a series of numbered files, which are read together."""
        ...

    def recognise(self, file: SourceFile) -> Certainty:
        """Judge by the content (``file.head``), and never by the name alone, in a short time.

        Raises:
            FormatError: If the beginning is of this format and the rest is not valid; the next
                format is then tried.
        """
        ...

    def read(self, file: SourceFile) -> Iterable[Piece]:
        """Read all pieces of the file, or of the series that it represents.

        Raises:
            FormatError: With a sentence that names the file and the field.
        """
        ...
