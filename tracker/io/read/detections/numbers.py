"""Rows of numbers under names that are not known, or under none, as one's own scripts write them.

The numbers say what a column is. The frame is the column of whole numbers that hardly ever fall,
of several the one with the most numbers; the score has parts of 1; the box is four columns beside
each other that are neither. Whether they are edges, corners or a middle is left to the boxes. A
column of words is that of the cameras, unless its name or its words are those of classes.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from tracker.io.read.columns import PEOPLE, Column, decimal_point, meanings, read_table
from tracker.io.read.pieces import Piece
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import SourceFile

NAME = "rows of numbers"
KIND: Kind = "detections"
SERIES = False

_FEWEST = 3
"""Rows by which columns can be told apart."""

_LOOKED_AT = 2000
"""Rows by which a file is recognised."""

_FALLS = 0.1
"""Share of rows before which a frame's number may fall: rows may be sorted by person."""

_MOST_CAMERAS = 64
"""Different words of a column up to which they may be names of cameras."""

_PARTS = 1.5
"""Numbers up to which boxes may be parts of the picture, which other formats have."""

_SIZES = 0.95
"""Share of boxes whose third and fourth number must be positive."""


class _Table(NamedTuple):
    header: tuple[str, ...]
    """The names of the columns; empty if there are none."""
    values: Float[ndarray, "N C"]
    words: Mapping[str, Sequence[str]] = MappingProxyType({})
    """The cells of columns of words, camera and class."""


class _Columns(NamedTuple):
    frame: int
    box: int
    """The first of four columns."""
    score: int | None


def recognise(file: SourceFile) -> Certainty:
    """Judge whether rows of numbers have a frame and a box."""
    lines = file.head_text.splitlines()
    lines = lines[:-1] if len(lines) > 1 and file.size > len(file.head) else lines
    table = _read(lines[:_LOOKED_AT])
    known = table is not None and _told_apart(table) is not None
    return Certainty.POSSIBLE if known else Certainty.NO


def read(file: SourceFile) -> Iterator[Piece]:
    """Read the boxes, one piece a camera if a column of cameras is named."""
    lines = file.lines()
    table = _read(lines)
    found = None if table is None else _columns(table)
    if found is None:
        raise file.error(
            f"expected rows of the same count of numbers, as in the first {_LOOKED_AT:,}, found "
            "others further down; it may be cut short or have rows of something else"
        )
    where, columns = found
    yield from read_table(file, f"{NAME} ({where})", columns)


def table_of(values: Float[ndarray, "N C"]) -> tuple[str, dict[str, Column]] | None:
    """Return where in rows of numbers what is, in words, and the columns by their meanings.

    Args:
        values: The rows.

    Returns:
        None if that is not clear.
    """
    usable = len(values) >= _FEWEST and values.shape[1] >= 5 and _exact(values)
    return _columns(_Table((), values)) if usable else None


def _columns(table: _Table) -> tuple[str, dict[str, Column]] | None:
    columns = _told_apart(table)
    if columns is None:
        return None
    frame, box, score = columns
    values = table.values
    found: dict[str, Column] = {
        **table.words,
        "frame": values[:, frame].tolist(),
        "box": values[:, box : box + 4].tolist(),
    }
    if score is not None:
        found["score"] = values[:, score].tolist()
    for meaning, name in meanings(table.header).items():
        if meaning in ("camera", "class", "id"):
            found[meaning] = [f"{value:g}" for value in values[:, table.header.index(name)]]
    scored = "" if score is None else f", score in {score + 1}"
    where = f"frame in column {frame + 1}, box in {box + 1} to {box + 4}{scored}"
    return where, found


def _read(lines: list[str]) -> _Table | None:
    """Return the rows of numbers below at most one row of names; None for anything else."""
    lines = [line for line in lines if line.strip()]
    while lines and lines[0].lstrip().startswith("#"):
        lines = lines[1:]
    if not lines:
        return None
    delimiter = next((sign for sign in ";\t," if sign in lines[-1]), None)
    cells = [[cell.strip() for cell in line.split(delimiter)] for line in lines]
    header: tuple[str, ...] = ()
    if re.search(r"[^\W\d_]", lines[0]) and all(_is_word(cell) for cell in cells[0]):
        header, cells = tuple(cells[0]), cells[1:]
    width = len(header) or len(cells[0])
    if len(cells) < _FEWEST or width < 5 or any(len(row) != width for row in cells):
        return None
    words, left = _words(header, cells)
    header = tuple(header[column] for column in left) if header else ()
    values = _numbers([[row[column] for column in left] for row in cells], delimiter)
    return None if values is None or len(left) < 5 else _Table(header, values, words)


def _words(
    header: Sequence[str], cells: Sequence[Sequence[str]]
) -> tuple[dict[str, list[str]], list[int]]:
    """Return the columns of words that are camera or class, and the index of all others."""
    left = [n for n in range(len(cells[0])) if not all(_is_word(row[n]) for row in cells)]
    named = {what: header.index(name) for what, name in meanings(header).items()}
    found: dict[str, list[str]] = {}
    for column in sorted({*range(len(cells[0]))} - {*left}):
        own = [row[column] for row in cells]
        several = 1 < len(set(own)) <= _MOST_CAMERAS
        people = bool({word.lower() for word in own} & {*PEOPLE})
        is_class = column == named.get("class") or ("class" not in named and people)
        if is_class:
            found.setdefault("class", own)
        elif column == named.get("camera") or ("camera" not in named and several):
            found.setdefault("camera", own)
    return found, left


def _is_word(cell: str) -> bool:
    """Whether a cell has a letter and is no number."""
    try:
        float(decimal_point(cell))
    except ValueError:
        return re.search(r"[^\W\d_]", cell) is not None
    return False


def _numbers(rows: list[list[str]], delimiter: str | None) -> Float[ndarray, "N C"] | None:
    """Return the cells as numbers, with decimal commas where these separate no columns."""
    if delimiter != ",":
        rows = [[decimal_point(cell) for cell in row] for row in rows]
    try:
        values = np.array(rows, dtype=float)
    except ValueError:
        return None
    return values if _exact(values) else None


def _exact(values: Float[ndarray, "N C"]) -> bool:
    """Whether all numbers are finite, and whole ones exact."""
    return bool(np.isfinite(values).all() and (np.abs(values) < 2**53).all())


def _told_apart(table: _Table) -> _Columns | None:
    """Return which column is what; None if that is not clear."""
    values = table.values
    named = {what: table.header.index(name) for what, name in meanings(table.header).items()}
    whole = (values == np.round(values)).all(axis=0)
    distinct = np.array([len(np.unique(column)) for column in values.T])
    rising = (np.diff(values, axis=0) < 0.0).mean(axis=0) <= _FALLS
    frames = np.flatnonzero(whole & rising & (values.min(axis=0) >= 0.0))
    if "frame" not in named and not len(frames):
        return None
    frame = named.get("frame", int(frames[distinct[frames].argmax()]) if len(frames) else 0)
    parts = (values >= 0.0).all(axis=0) & (values <= 1.0).all(axis=0)
    scores = np.flatnonzero(parts & ~whole)
    score = named.get("score", int(scores[0]) if len(scores) else None)
    free = ~parts & (distinct > 1)
    free[[frame, *([] if score is None else [score])]] = False
    free[[named[what] for what in ("id", "class", "camera") if what in named]] = False
    box = _box(values, free, whole, distinct)
    return None if box is None else _Columns(frame, box, score)


def _box(
    values: Float[ndarray, "N C"],
    free: Bool[ndarray, " C"],
    whole: Bool[ndarray, " C"],
    distinct: ndarray,
) -> int | None:
    """Return the first of the four columns of a box; None if it is not clear.

    Where five are beside each other, one is the number of a person or a class: the first or last,
    which alone is whole or has the fewest different numbers.
    """
    edges = np.flatnonzero(np.diff(np.r_[False, free, False].astype(int)))
    runs = [(first, last) for first, last in edges.reshape(-1, 2).tolist() if last - first >= 4]
    if len(runs) != 1:
        return None
    first, last = runs[0]
    if last - first == 5:
        ends = [first, last - 1]
        alone = [end for end in ends if whole[end] and not whole[first + 1 : last - 1].any()]
        fewest = [
            end
            for end in ends
            if distinct[end] < np.delete(distinct[first:last], end - first).min()
        ]
        marked = alone if len(alone) == 1 else fewest
        if len(marked) != 1:
            return None
        first += marked[0] == first
    elif last - first != 4:
        return None
    four = values[:, first : first + 4]
    sized = (four[:, 2:] > 0.0).all(axis=1).mean() >= _SIZES
    return first if sized and (four.max(axis=0) > _PARTS).all() else None
