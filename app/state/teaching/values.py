"""What a person draws and drags, as the values that a sequence's file has."""

from __future__ import annotations

from typing import Any

from tracker.sequences.errors import SequenceError
from tracker.sequences.reader import FILE
from tracker.sequences.sequence import Sequence
from tracker.sequences.writing.teaching import Values

PIXEL_DIGITS, METRE_DIGITS = 1, 3
"""Decimals to which a drawn box (pixels) and a dragged place (metres) are rounded."""

LEAST_BOX = 4.0
"""Pixels of a template's side: what is smaller has no colours to speak of."""


def rounded(value: float) -> float:
    """A place as it is written: rounded, and without a negative zero."""
    return round(float(value), METRE_DIGITS) + 0.0


def within(sequence: Sequence, camera: str, box: tuple[float, float, float, float]) -> list[float]:
    """A drawn box without what sticks out of its picture.

    Raises:
        SequenceError: If less than :data:`LEAST_BOX` is left.
    """
    sizes = {c.name: c.image_size for c in sequence.cameras}
    if camera not in sizes or not all(abs(value) < 1e6 for value in box):
        return list(box)  # the check says what is wrong with it
    left, top, width, height = box
    ends = [(left, width, sizes[camera][0]), (top, height, sizes[camera][1])]
    (x0, x1), (y0, y1) = ((max(0.0, a), min(float(size), a + b)) for a, b, size in ends)
    cut = [round(value, PIXEL_DIGITS) for value in (x0, y0, x1 - x0, y1 - y0)]
    if min(cut[2:]) < LEAST_BOX:
        raise SequenceError(
            f"{sequence.folder.name}/{FILE}, new template, box: expected at least {LEAST_BOX:g} "
            f"pixels a side inside the picture, found {max(0.0, cut[2]):g} × {max(0.0, cut[3]):g}; "
            "drag a larger one"
        )
    return cut


def at(values: Values, key: str, index: int) -> dict[str, Any]:
    """One table of a list of tables.

    Raises:
        SequenceError: If there is none of that number.
    """
    found: list[dict[str, Any]] = values[key]
    if not 0 <= index < len(found):
        raise SequenceError(f"{key}: expected one of {len(found)}, found number {index + 1}")
    return found[index]


def take(found: list[Any], word: str, index: int) -> None:
    """Take one out of a list.

    Raises:
        SequenceError: If there is none of that number.
    """
    if not 0 <= index < len(found):
        raise SequenceError(f"{word}: expected one of {len(found)}, found number {index + 1}")
    del found[index]
