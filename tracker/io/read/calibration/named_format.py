"""A calibration format whose fields have their usual names, wherever they lie in the file."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, ClassVar

from tracker.io.read.calibration.camera_fields import cameras, has_cameras
from tracker.io.read.pieces import CalibrationPiece, Convention, Piece
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import SourceFile


@dataclass(frozen=True, slots=True)
class NamedFormat:
    """Cameras told by the names of their fields, recognised where there is a camera."""

    KIND: ClassVar[Kind] = "calibration"
    SERIES: ClassVar[bool] = False

    NAME: str
    values: Callable[[SourceFile], Any]
    """The function that makes tables and lists of a file."""
    may_be: Callable[[SourceFile], bool]
    """Whether the beginning of a file may be of the format, so that it is worth parsing."""
    certainty: Certainty = Certainty.POSSIBLE
    convention: Convention = field(default_factory=Convention)

    def recognise(self, file: SourceFile) -> Certainty:
        """The beginning, and a table with a camera's fields."""
        known = self.may_be(file) and has_cameras(self.values(file))
        return self.certainty if known else Certainty.NO

    def read(self, file: SourceFile) -> Iterator[Piece]:
        """One piece with every camera of the file."""
        found = cameras(file, self.values(file), self.convention)
        yield CalibrationPiece(file.path, self.NAME, tuple(found))
