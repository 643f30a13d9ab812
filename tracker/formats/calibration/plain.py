"""JSON or YAML of one's own script: tables with K, R and t by their usual names."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from tracker.formats.calibration.camera_fields import cameras, has_cameras
from tracker.formats.pieces import CalibrationPiece, Convention, FormatError, Piece
from tracker.formats.protocol import Certainty, Kind
from tracker.formats.source import SourceFile

NAME = "JSON or YAML with K, R, t"
KIND: Kind = "calibration"
SERIES = False


def recognise(file: SourceFile) -> Certainty:
    """JSON or YAML that holds a table with a camera's fields."""
    head = file.head_text.lstrip()
    try:
        if head[:1] in ("{", "[") or (":" in head and "\n" in head and "<" not in head[:1]):
            return Certainty.POSSIBLE if has_cameras(_values(file)) else Certainty.NO
    except FormatError:  # some other text
        if head[:1] in ("{", "["):
            raise
    return Certainty.NO


def read(file: SourceFile) -> Iterator[Piece]:
    """One piece with every camera of the file; nothing is known of the convention."""
    yield CalibrationPiece(file.path, NAME, tuple(cameras(file, _values(file), Convention())))


def _values(file: SourceFile) -> Any:
    return file.json if file.head_text.lstrip()[:1] in ("{", "[") else file.yaml
