"""Appearance vectors of an outside network, one for each box: a ``.npy`` beside the table."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jaxtyping import Float16
from numpy import ndarray

from tracker.files.text import shown
from tracker.sequences.errors import SequenceError
from tracker.sequences.fields import Fields

LONGEST = 4096
"""Numbers of a vector: networks that tell people apart give 128 to 2048."""

_AT_ONCE = 4096
"""Rows that are in memory with all their digits."""

_KINDS = "f"
"""Floating point."""


def read_appearance(path: Path, fields: Fields, boxes: str, rows: int) -> Float16[ndarray, "N A"]:
    """Unit vectors in the order of a table's rows; 0 stays 0, and means that nothing is known.

    Args:
        path: The file.
        fields: Of the camera that names it in ``appearance``.
        boxes: The table's name, for the messages.
        rows: How many it has.

    Raises:
        SequenceError: If it is no such array, or not all of it are numbers.
    """

    def wrong(problem: str) -> SequenceError:
        return fields.error("appearance", f'"{path.name}": {problem}')

    try:
        values = np.lib.format.open_memmap(path, mode="r")
    except (OSError, ValueError, EOFError, TypeError, SyntaxError, MemoryError, OverflowError):
        raise wrong(
            "expected an array of numbers in NumPy's format .npy, found none; write it with "
            "numpy.save"
        ) from None
    if values.ndim != 2 or values.dtype.kind not in _KINDS or values.dtype.itemsize > 8:
        size = " × ".join(map(str, values.shape)) or "one number"
        raise wrong(
            "expected a table of floating-point numbers, rows × length of a vector, found "
            f"{size} of {shown(str(values.dtype))}; convert it"
        )
    if len(values) != rows:
        raise wrong(
            f'expected a row for each of the {rows:,} rows of "{boxes}", found {len(values):,}; '
            "write both in one order"
        )
    if not 1 <= values.shape[1] <= LONGEST:
        raise wrong(
            f"expected vectors of 1 to {LONGEST:,} numbers, found {values.shape[1]:,}; shorten them"
        )
    units = np.zeros(values.shape, dtype=np.float16)
    for first in range(0, rows, _AT_ONCE):
        some = np.array(values[first : first + _AT_ONCE], dtype=np.float64)
        bad = ~np.isfinite(some).all(axis=1)
        if bad.any():
            raise wrong(
                f"expected numbers, found one that is none in row {first + int(np.argmax(bad))} "
                "(counted from 0); write zeros where nothing is known of a box"
            )
        largest = np.abs(some).max(axis=1, keepdims=True)
        some /= np.where(largest > 0.0, largest, 1.0)  # their squares may be beyond all numbers
        lengths = np.linalg.norm(some, axis=1, keepdims=True)
        units[first : first + _AT_ONCE] = some / np.where(lengths > 0.0, lengths, 1.0)
    return units
