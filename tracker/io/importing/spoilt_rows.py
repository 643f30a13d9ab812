"""The rows of a text table that cannot be read, so that one of them costs no camera its boxes."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass

import numpy as np

from tracker.files.text import shown
from tracker.io.read.columns import decimal_points, delimiter_of
from tracker.io.read.source import MOST_TREE_BYTES, SourceFile

_FEWEST = 10
"""Fewest rows by which it is judged what a row is."""

_MOSTLY = 0.9
"""Share of a column's cells that are numbers where the column is one of numbers."""

_LARGEST = 2.0**53
"""Largest number, beyond which whole numbers are not exact."""


@dataclass(frozen=True, slots=True)
class ReadableRows:
    """A table without the rows that cannot be read."""

    lines: list[str]
    """The other lines, the header included."""
    left_out: str
    """A sentence about the rows that are left out."""


def readable_rows(file: SourceFile, most: float) -> ReadableRows | None:
    """Leave out the rows of a text table that are not like its others.

    These are rows with another count of cells than most, or without a number in a column that is
    one of numbers: 90 % of its cells are.

    Args:
        file: The file.
        most: Largest share of rows that may be left out.

    Returns:
        The rows; None if the file is no table, or none of its rows or too many are unlike.

    Raises:
        FormatError: If the file cannot be read as text.
    """
    if not is_table(file):
        return None
    lines = file.lines()
    rows = [k for k, line in enumerate(lines) if line.strip() and not line.startswith("#")]
    if not rows:
        return None
    cells = {k: _cells(lines[k]) for k in rows}
    if any(_number(cell) is None for cell in cells[rows[0]]):  # names of columns
        rows = rows[1:]
    if len(rows) < _FEWEST:
        return None
    width = Counter(len(cells[k]) for k in rows).most_common(1)[0][0]
    table = {k: [_number(cell) for cell in cells[k]] for k in rows if len(cells[k]) == width}
    numbers = np.array([[value is not None for value in row] for row in table.values()])
    finite = np.array(
        [[value is not None and math.isfinite(value) for value in row] for row in table.values()]
    )
    fits = np.where(finite.mean(axis=0) >= _MOSTLY, finite, numbers)
    fits = (fits | (numbers.mean(axis=0) < _MOSTLY)).all(axis=1)
    good = {k for k, own in zip(table, fits, strict=True) if own}
    spoilt = [k for k in rows if k not in good]
    if not 0 < len(spoilt) <= most * len(rows):
        return None
    count = f"{len(spoilt)} of {len(rows)} rows ({100.0 * len(spoilt) / len(rows):.2g} %)"
    first = spoilt[0]
    return ReadableRows(
        [line for k, line in enumerate(lines) if k not in set(spoilt)],
        f"{file.where}: {count} cannot be read and are left out, the first in line {first + 1}: "
        f"{shown(lines[first])}.",
    )


def is_table(file: SourceFile) -> bool:
    """Whether a file is text of rows rather than a tree, and not too large to look at each row."""
    return (
        file.is_text
        and file.size <= MOST_TREE_BYTES
        and file.head_text.lstrip()[:1] not in ("[", "{", "<")
    )


def _cells(line: str) -> list[str]:
    line = decimal_points(line)
    delimiter = delimiter_of(line)
    return [cell.strip() for cell in (line.split(delimiter) if delimiter in line else line.split())]


def _number(cell: str) -> float | None:
    """Return the number of a cell, infinite where it is too large; None for none."""
    try:
        value = float(cell.replace(",", ".").strip('"'))
    except ValueError:
        return None
    return value if abs(value) <= _LARGEST else math.inf
