"""Short pieces of every recording: some steps of a sequence as a sequence of their own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy import ndarray

from tracker.sequences.library import open_sequence
from tracker.sequences.reader import read_sequence
from tracker.sequences.sequence import Detections, GroundTruth, Sequence, View

_Rows = TypeVar("_Rows", Detections, GroundTruth)


@dataclass(frozen=True, slots=True)
class Piece:
    """Which steps of which recording."""

    name: str
    real: bool
    """Whether it is one of the recordings beside the checkout, else a rendered room."""
    pictures: bool
    """Whether people are found in pictures, else given as boxes."""
    first: int
    frames: int
    """Of the piece: the background is learnt of them, and their templates are known."""
    steps: int
    """That are tracked, from the first on."""
    long_steps: int
    """That are tracked in the longer form."""

    def open(self, data: Path) -> Sequence:
        """The piece as a sequence.

        Args:
            data: The folder of the real recordings.
        """
        sequence = read_sequence(data / self.name) if self.real else open_sequence(self.name)
        return cut(sequence, self.first, self.frames)


PIECES: tuple[Piece, ...] = (
    # in the rooms each begins where all are inside and templates of every person follow
    Piece("room24-2p", False, True, 200, 800, 40, 200),
    Piece("room35-2p", False, True, 270, 800, 40, 200),
    Piece("room44-3p", False, True, 360, 800, 40, 200),
    Piece("av163-seq30-2p-1101", True, True, 60, 440, 40, 200),
    Piece("av163-seq45-3p-1111-points", True, False, 300, 600, 50, 600),
    Piece("cmc1", True, False, 60, 201, 50, 201),
    Piece("cmc2", True, False, 60, 201, 40, 201),
    Piece("wildtrack-points-300", True, False, 150, 100, 24, 100),
)
"""Every recording at hand."""


def cut(sequence: Sequence, first: int, steps: int) -> Sequence:
    """Steps ``first`` … ``first + steps − 1`` of a sequence, counted from 0 again.

    Templates whose picture is not among them are left out.
    """
    last = min(first + steps, sequence.frames)

    def rows(table: _Rows) -> _Rows:
        inside = (table.frames >= first) & (table.frames < last)
        return _taken(table, inside, first)

    def view(one: View) -> View:
        boxes = one.detections
        return replace(
            one,
            first_frame=one.first_frame + first,
            detections=None if boxes is None else rows(boxes),
        )

    templates = [one for one in sequence.templates if first <= one.frame < last]
    truth = sequence.ground_truth
    return replace(
        sequence,
        frames=last - first,
        views=tuple(view(one) for one in sequence.views),
        templates=tuple(replace(one, frame=one.frame - first) for one in templates),
        ground_truth=None
        if truth is None
        else replace(rows(truth), known=None if truth.known is None else truth.known[first:last]),
        digest=f"{sequence.digest}-{first}-{last}",
    )


def _taken(table: _Rows, inside: ndarray, first: int) -> _Rows:
    columns: dict[str, ndarray] = {
        name: getattr(table, name)[inside]
        for name in type(table).__slots__
        if name != "known"  # of steps, not of rows
        and not (name == "embeddings" and not getattr(table, name).shape[1])  # nobody told
    }
    columns["frames"] = columns["frames"] - first
    make: Callable[..., _Rows] = type(table)
    return make(**{name: np.ascontiguousarray(column) for name, column in columns.items()})
