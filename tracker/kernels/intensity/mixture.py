"""The hot loops over Gaussian mixtures of any size: predict, sort, pick."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tracker.kernels.compilation import kernel

_FEW = 48
"""Up to so many weights are sorted by insertion."""

_DIGIT = 10
"""Bits that one pass of sorting looks at."""


class Moments(NamedTuple):
    """Where J components are."""

    means: ndarray
    """(J, d)."""
    covariances: ndarray
    """(J, d, d)."""


@kernel
def predict(means: ndarray, covariances: ndarray, transition: ndarray, noises: ndarray) -> Moments:
    """F m and F P Fᵀ + Q of every component, symmetric to the last bit.

    Args:
        means: (J, d).
        covariances: (J, d, d).
        transition: F (d, d).
        noises: Q, (1, d, d) for all, or (J, d, d).
    """
    dimension = means.shape[1]
    if dimension == 4:
        return _predicted(means, covariances, transition, noises, (0, 1, 2, 3))
    return _predicted(means, covariances, transition, noises, range(dimension))


@kernel
def _predicted(
    means: ndarray, covariances: ndarray, transition: ndarray, noises: ndarray, axes: Sequence[int]
) -> Moments:
    """:func:`predict` for axes that are a range, or, to have loops unrolled, a tuple of as many."""
    moved = np.empty(means.shape)
    spread = np.empty(covariances.shape)
    half = np.empty(transition.shape)
    for j in range(len(means)):
        for a in range(len(axes)):
            total = 0.0
            for b in range(len(axes)):
                total += transition[a, b] * means[j, b]
            moved[j, a] = total
            for b in range(len(axes)):
                total = 0.0
                for c in range(len(axes)):
                    total += transition[a, c] * covariances[j, c, b]
                half[a, b] = total
        noise = 0 if len(noises) == 1 else j
        for a in range(len(axes)):
            for b in range(a + 1):
                total = 0.5 * (noises[noise, a, b] + noises[noise, b, a])
                for c in range(len(axes)):
                    total += half[a, c] * transition[b, c]
                spread[j, a, b] = total
                spread[j, b, a] = total
    return Moments(moved, spread)


@kernel
def _insert(weights: ndarray, order: ndarray, most: int) -> bool:
    """Sort by insertion, heaviest first; False, half done, if it takes more than ``most`` moves."""
    for k in range(1, len(order)):
        i = order[k]
        place = k
        while place > 0 and weights[order[place - 1]] < weights[i]:
            order[place] = order[place - 1]
            place -= 1
        order[place] = i
        most -= k - place
        if most < 0:
            return False
    return True


@kernel
def heaviest_first(weights: ndarray) -> ndarray:
    """Indices of weights (J,), none negative, heaviest first; of equal ones the first comes first.

    Few are sorted by insertion. Of many the bits are: those of a positive number are in the
    order of the numbers. The upper ones, a pass for each digit of them, nearly do it, and
    insertion does the rest; if that takes long, all bits are looked at.
    """
    size = len(weights)
    order = np.arange(size)
    if size <= _FEW:
        _insert(weights, order, size * size)
        return order
    # a negative zero becomes a positive one; what is heavier becomes what is smaller
    keys = ~((weights + 0.0).view(np.uint64))
    keys -= keys.min()
    highest = keys.max()
    bits = 0
    while bits < 64 and highest >> np.uint64(bits):
        bits += 1
    for first in (max(bits - 2 * _DIGIT, 0), 0):
        order = np.arange(size)
        _sort_bits(keys, order, first, bits)
        if _insert(weights, order, 4 * size):
            break
    return order


@kernel
def _sort_bits(keys: ndarray, order: ndarray, first: int, last: int) -> None:
    """Sort ``order`` by some bits of the keys, smallest first, keeping the order of equal ones."""
    other = np.empty_like(order)
    mask = np.uint64((1 << _DIGIT) - 1)
    begins = np.empty((1 << _DIGIT) + 1, dtype=np.int64)
    for shift in range(first, last, _DIGIT):
        places = np.uint64(shift)
        begins[:] = 0
        for key in keys:
            begins[np.int64((key >> places) & mask) + 1] += 1
        for digit in range(1 << _DIGIT):
            begins[digit + 1] += begins[digit]
        for i in order:
            own = np.int64((keys[i] >> places) & mask)
            other[begins[own]] = i
            begins[own] += 1
        order[:] = other


@kernel
def heaviest_of_groups(weights: ndarray, group: ndarray, count: int) -> ndarray:
    """The heaviest of each group 0 … count - 1, of equal ones the last; -1 where it is empty.

    Who is in the group -1 is left out.
    """
    heaviest = np.full(count, -1, dtype=np.int64)
    for i in range(len(weights)):
        if group[i] < 0:
            continue
        best = heaviest[group[i]]
        if best < 0 or weights[i] >= weights[best]:
            heaviest[group[i]] = i
    return heaviest
