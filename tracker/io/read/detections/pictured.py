"""Boxes of a series of files, one a picture, whose names tell the frames."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.io.read.columns import only_people
from tracker.io.read.picture_names import number_in
from tracker.io.read.pieces import DetectionPiece
from tracker.io.read.source import SourceFile
from tracker.io.read.values import stated_size


class PicturedBoxes:
    """The boxes of one camera, gathered picture by picture."""

    def __init__(self, file: SourceFile) -> None:
        """Nothing is gathered yet.

        Args:
            file: The first of the series.
        """
        self._file = file
        self._looked_at: list[int] = []
        self._frames: list[int] = []
        self._corners: list[ndarray] = []
        self._labels: list[str] = []
        self._size: tuple[int, int] | None = None

    def pictures(self) -> Iterator[SourceFile]:
        """The file of each picture in turn; what is added meanwhile is of its frame.

        A frame is the number in the file's name, else the file's place in the series.
        """
        for place, path in enumerate(self._file.series):
            number = number_in(path.name)
            self._looked_at.append(place if number is None else number)
            yield self._file.member(path)

    def sized(self, width: Any, height: Any) -> None:
        """The pictures' size in pixels, where it can be one."""
        self._size = stated_size(width, height) or self._size

    def add(self, corners: Float[ndarray, " 4"], label: str) -> None:
        """A box in the picture at hand: left, top, right and bottom, and what it is of."""
        self._frames.append(self._looked_at[-1])
        self._corners.append(corners)
        self._labels.append(label)

    def piece(self, format_name: str) -> DetectionPiece:
        """All that are people."""
        piece = DetectionPiece(
            source=self._file.path,
            format=format_name,
            camera="",
            frames=np.array(self._frames, dtype=np.int64),
            boxes=np.array(self._corners).reshape(-1, 4),
            scores=np.ones(len(self._frames)),
            layout="xyxy",
            first_index=0 if 0 in self._looked_at else None,
            last_frame=max([0, *self._looked_at]),
            image_size=self._size,
        )
        return only_people(self._file, piece, self._labels)
