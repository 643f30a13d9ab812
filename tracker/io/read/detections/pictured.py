"""Boxes that people drew in pictures, gathered picture by picture: a piece a camera."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.io.read.columns import only_people
from tracker.io.read.pieces import DetectionPiece, Layout
from tracker.io.read.source import SourceFile
from tracker.io.read.values import stated_size

Box = Sequence[float] | Float[ndarray, " 4"]
"""The four numbers of a box."""


@dataclass(slots=True)
class _Camera:
    """The boxes of one camera so far."""

    looked_at: list[int] = field(default_factory=list)
    frames: list[int] = field(default_factory=list)
    boxes: list[Box] = field(default_factory=list)
    labels: list[str] = field(default_factory=list)
    size: tuple[int, int] | None = None
    first_index: Literal[0, 1] | None = None


class PicturedBoxes:
    """The boxes of a file, or of a series of a file a picture."""

    def __init__(
        self, file: SourceFile, format_name: str, layout: Layout = "xyxy", *, parts: bool = False
    ) -> None:
        """Nothing is gathered yet.

        Args:
            file: The file, or the first of the series.
            format_name: The format, as it is shown.
            layout: What the four numbers of a box are.
            parts: Whether they are parts of the picture's size rather than pixels.
        """
        self._file = file
        self._format = format_name
        self._layout: Layout = layout
        self._parts = parts
        self._cameras: dict[str, _Camera] = {}
        self._own = _Camera()

    def look_at(self, camera: str, frame: int, first_index: Literal[0, 1] | None = None) -> None:
        """Turn to a picture: what is added from now on is of its camera and frame.

        Args:
            camera: The camera; empty where the file's name has to tell it.
            frame: The frame.
            first_index: The number of the camera's first frame, where it is known.
        """
        self._own = self._cameras.setdefault(camera, _Camera())
        self._own.looked_at.append(frame)
        if first_index is not None or (frame == 0 and self._own.first_index is None):
            self._own.first_index = first_index or 0

    def pictures(self) -> Iterator[SourceFile]:
        """Yield the file of each picture of a series in turn, looking at its frame."""
        for frame, member in self._file.frames():
            self.look_at("", frame)
            yield member

    def sized(self, width: Any, height: Any) -> None:
        """State the pictures' size in pixels, which counts where it can be one."""
        self._own.size = stated_size(width, height) or self._own.size

    def add(self, box: Box, label: str) -> None:
        """Add a box of the picture at hand, and what it is of."""
        self._own.frames.append(self._own.looked_at[-1])
        self._own.boxes.append(box)
        self._own.labels.append(label)

    def pieces(self) -> Iterator[DetectionPiece]:
        """Yield the boxes that are people's, a piece a camera."""
        for camera, own in self._cameras.items():
            piece = DetectionPiece(
                source=self._file.path,
                format=self._format,
                camera=camera,
                frames=np.array(own.frames, dtype=np.int64),
                boxes=np.array(own.boxes, dtype=float).reshape(-1, 4),
                scores=np.ones(len(own.frames)),
                layout=self._layout,
                normalised=self._parts,
                first_index=own.first_index,
                last_frame=max(own.looked_at),
                image_size=own.size,
            )
            yield only_people(self._file, piece, own.labels)
