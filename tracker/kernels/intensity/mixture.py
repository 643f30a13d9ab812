"""The hot loops over Gaussian mixtures of any size: predict, sort, pick."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tracker.kernels.compilation import kernel

_FEW = 48
"""Number of weights up to which they are sorted by insertion."""

_DIGIT = 10
"""Number of bits of a digit in one pass of the radix sort."""


class Moments(NamedTuple):
    """Means and covariances of J components."""

    means: ndarray
    """(J, d), states."""
    covariances: ndarray
    """(J, d, d), covariances."""


@kernel
def predict(means: ndarray, covariances: ndarray, transition: ndarray, noises: ndarray) -> Moments:
    """Compute F m and F P Fᵀ + Q of every component, symmetric to the last bit.

    Args:
        means: (J, d), states.
        covariances: (J, d, d), covariances.
        transition: F (d, d), of one step.
        noises: Q, (1, d, d) for all, or (J, d, d), the process noise of one step.
    """
    dimension = means.shape[1]
    if dimension == 4:
        return _predicted(means, covariances, transition, noises, (0, 1, 2, 3))
    return _predicted(means, covariances, transition, noises, range(dimension))


@kernel
def _predicted(
    means: ndarray, covariances: ndarray, transition: ndarray, noises: ndarray, axes: Sequence[int]
) -> Moments:
    """:func:`predict` for axes that are a range, or a tuple of as many for unrolled loops."""
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
    """The indices of weights (J,), none negative, heaviest first; equal ones in ascending order.

    Few are sorted by insertion. Many are sorted by radix, since the bits of a positive number are
    in the order of the numbers: a pass for each digit of the upper bits nearly sorts them, and
    insertion completes it; where that takes long, all bits are sorted.
    """
    size = len(weights)
    order = np.arange(size)
    if size <= _FEW:
        _insert(weights, order, size * size)
        return order
    # a negative zero becomes a positive one; heavier weights become smaller keys
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
    """Sort ``order`` stably by some bits of the keys, smallest first."""
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
    """The heaviest component of each group 0 … count - 1, the last of equal ones; -1 for none.

    Components of the group -1 are left out.
    """
    heaviest = np.full(count, -1, dtype=np.int64)
    for i in range(len(weights)):
        if group[i] < 0:
            continue
        best = heaviest[group[i]]
        if best < 0 or weights[i] >= weights[best]:
            heaviest[group[i]] = i
    return heaviest
