"""Pictures that are numbered one by one: which of the row are not there.

A picture that was deleted leaves a hole in the numbers. Whoever took the files one after the
other would show every later picture a step too early.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Bool
from numpy import ndarray

_DIGITS = re.compile(r"(\d+)")


def whole_row(images: Sequence[Path]) -> tuple[tuple[Path, ...], Bool[ndarray, " N"]]:
    """The pictures with those that are missing between them, by the numbers in their names.

    Names that differ in one number alone, by one usual distance or multiples of it, are such a
    row. Where more would be missing than are there, the numbers count something else.

    Args:
        images: In their order.

    Returns:
        The row, with the name that a missing picture would have, and which of it are there.
    """
    files = tuple(images)
    everything = np.ones(len(files), dtype=bool)
    parts = [_DIGITS.split(file.as_posix()) for file in files]
    place = _place(parts)
    if place is None or len(files) < 3 or max(len(one[place]) for one in parts) > 15:
        return files, everything
    numbers = np.array([int(one[place]) for one in parts], dtype=np.int64)
    distances = np.diff(numbers)
    values, counts = np.unique(distances, return_counts=True)
    usual = int(values[np.argmax(counts)])
    if distances.min() <= 0 or (distances % usual).any():
        return files, everything
    index = (numbers - numbers[0]) // usual
    length = int(index[-1]) + 1
    if length > 2 * len(files):
        return files, everything
    there = np.zeros(length, dtype=bool)
    there[index] = True
    last = np.cumsum(there) - 1
    row = [
        files[last[k]] if there[k] else _called(parts[last[k]], place, int(numbers[0]) + usual * k)
        for k in range(length)
    ]
    return tuple(row), there


def _place(parts: Sequence[Sequence[str]]) -> int | None:
    """Which part of the names differs, where they are split at their numbers, and no other does."""
    if not parts or any(len(one) != len(parts[0]) for one in parts):
        return None
    differing = [k for k, values in enumerate(zip(*parts, strict=True)) if len(set(values)) > 1]
    return differing[0] if len(differing) == 1 and differing[0] % 2 else None


def _called(like: Sequence[str], place: int, number: int) -> Path:
    """The name of a picture with another number, with as many digits."""
    digits = f"{number:0{len(like[place])}}"
    return Path("".join([*like[:place], digits, *like[place + 1 :]]))
