"""NumPy's arrays of boxes or places: rows of numbers (``.npy``), or columns by name (``.npz``).

An ``.npz`` has a column under each name (``frames``, ``boxes``, ``scores``; ``ids``,
``positions``), or the rows of each camera under its name. Which of the numbers of a row without
names is what is told as in a text.

Source: NumPy, "numpy.lib.format".
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy import ndarray

from tracker.io.read.columns import Column, is_table, read_table, singular
from tracker.io.read.detections import numbers
from tracker.io.read.pieces import Piece
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import NPY, ZIP, SourceFile, read_npy, read_npz

NAME = "NumPy arrays of boxes or places"
KIND: Kind = "detections"
SERIES = False

MOST_BYTES = 64 * 2**20
"""Of a file, packed and unpacked: a few bytes may stand for gigabytes."""


def recognise(file: SourceFile) -> Certainty:
    """Judge whether columns are named as those of boxes or places, or rows have a frame and a
    box."""
    known = file.head.startswith((NPY, ZIP)) and any(True for _ in _tables(file))
    return Certainty.POSSIBLE if known else Certainty.NO


def read(file: SourceFile) -> Iterator[Piece]:
    """Read the boxes, one piece a camera, or the places."""
    for name, columns in _tables(file):
        yield from read_table(file, name, columns)


def _tables(file: SourceFile) -> Iterator[tuple[str, Mapping[str, Column]]]:
    """The columns of each table by their names, after what it is called."""
    arrays = _arrays(file)
    together = {singular(name): _cells(own) for name, own in arrays.items() if own.ndim}
    if len({len(cells) for cells in together.values()}) == 1 and is_table([*together]):
        yield NAME, together
        return
    for name, own in arrays.items():
        if own.dtype.names:
            columns: dict[str, Column] = {one: _cells(own[one]) for one in own.dtype.names}
            if is_table([*columns]):
                yield NAME, columns
        elif own.ndim == 2 and np.issubdtype(own.dtype, np.number):
            found = numbers.table_of(own.astype(float))
            if found is not None:
                where, columns = found
                yield f"{NAME} ({where})", {**columns, "camera": [name] * len(own)}


def _cells(own: ndarray) -> Column:
    cells: list[Any] = own.tolist()
    return cells


def _arrays(file: SourceFile) -> dict[str, ndarray]:
    """The arrays of a file by their names; that of an ``.npy`` without one."""
    if file.size > MOST_BYTES:
        return {}
    data = file.bytes(MOST_BYTES)
    try:
        if data.startswith(NPY):
            return {"": read_npy(data)}
        return read_npz(data, MOST_BYTES) or {}
    except (ValueError, EOFError):
        return {}  # other arrays, or some other archive
