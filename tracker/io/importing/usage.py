"""Which of the files that were named a recording is made of, and why the others are not used."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from tracker.io.read.pieces import ImagesPiece, VideoPiece

if TYPE_CHECKING:
    from tracker.io.importing.gathering import ParsedFiles

_UNKNOWN = "no format that is read"


@dataclass(frozen=True, slots=True, eq=False)
class FileUse:
    """A file, or a series of numbered ones, and how many of them are used."""

    files: ParsedFiles
    used: int
    """The number of files that are used, at most :attr:`ParsedFiles.count`."""
    why: str
    """Why not all are used; empty where all are, and where sentences on the cameras say it."""


def file_uses(taken: Sequence[ParsedFiles], sources: frozenset[Path] | None) -> list[FileUse]:
    """Judge all files.

    A file whose content was read with another one's is used where that one is.

    Args:
        taken: All files.
        sources: The files that the recording is made of; None while that is not known, when all
            that were read count.
    """
    used = {one.label: _used(one, sources) for one in taken}
    found = []
    for one in taken:
        count = one.count if one.read_with and used.get(one.read_with) else used[one.label]
        why = "" if count == one.count or one.pieces else one.complaint or _UNKNOWN
        found.append(FileUse(one, count, why))
    return found


def _used(one: ParsedFiles, sources: frozenset[Path] | None) -> int:
    if not one.pieces:
        return 0
    if sources is None:
        return one.count
    own: set[Path] = set()
    for piece in one.pieces:
        if isinstance(piece, ImagesPiece):
            own.update(piece.files)
        else:
            own.add(piece.path if isinstance(piece, VideoPiece) else piece.source)
    there = own & sources
    # of a series that is read as a whole the pieces name a file or two
    return len(there) if len(own) == one.count else one.count * bool(there)
