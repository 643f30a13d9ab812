"""Missing pictures of a numbered series.

A picture that was deleted leaves a gap in the numbers. If the gap were ignored, every later picture
would be shown a step too early.
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
    """Complete a series of pictures with those that are missing, by the numbers in their names.

    The names of a series differ in one number alone, whose steps are multiples of the most frequent
    step. If more pictures would be missing than exist, the numbers are not taken as those of a
    series.

    Args:
        images: The existing pictures in their order.

    Returns:
        The series, with the names that missing pictures would have, and whether each exists.
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


def by_number(text: str) -> list[str | int]:
    """Return a sort key that orders numbers in names by value."""
    return [int(part) if k % 2 else part for k, part in enumerate(_DIGITS.split(text))]


def _place(parts: Sequence[Sequence[str]]) -> int | None:
    """Return the index of the only part that differs between names, if it is a number; else None.

    Args:
        parts: The names, each split at its numbers.
    """
    if not parts or any(len(one) != len(parts[0]) for one in parts):
        return None
    differing = [k for k, values in enumerate(zip(*parts, strict=True)) if len(set(values)) > 1]
    return differing[0] if len(differing) == 1 and differing[0] % 2 else None


def _called(like: Sequence[str], place: int, number: int) -> Path:
    """Return the name of a picture with another number, padded to the same length."""
    digits = f"{number:0{len(like[place])}}"
    return Path("".join([*like[:place], digits, *like[place + 1 :]]))
