"""A folder of numbered pictures."""

from __future__ import annotations

from collections.abc import Iterator

from tracker.io.read.pieces import ImagesPiece, Piece
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import SourceFile
from tracker.sequences.pictures.numbering import by_number, whole_row
from tracker.sequences.pictures.video import read_image, why_no_picture

NAME = "numbered pictures"
KIND: Kind = "pictures"
SERIES = True

_STARTS = (b"\xff\xd8\xff", b"\x89PNG\r\n", b"BM", b"II*\0", b"MM\0*")


def recognise(file: SourceFile) -> Certainty:
    """The signature of JPEG, PNG, BMP, TIFF or WebP, in a series of at least two."""
    webp = file.head[:4] == b"RIFF" and file.head[8:12] == b"WEBP"
    is_it = (file.head.startswith(_STARTS) or webp) and len(file.series) > 1
    return Certainty.SURE if is_it else Certainty.NO


def read(file: SourceFile) -> Iterator[Piece]:
    """One piece, its size that of the first picture."""
    picture = read_image(file.series[0])
    if picture is None:
        raise file.member(file.series[0]).error(why_no_picture(file.series[0]))
    files, _ = whole_row(sorted(file.series, key=lambda path: by_number(path.name)))
    yield ImagesPiece(file.path.parent, files, (picture.shape[1], picture.shape[0]))
