"""The hot loops over Gaussian mixtures of any size: predict, sort, pick."""

from __future__ import annotations

import numpy as np
from numpy import ndarray

from tracker.kernels import _kernel

_FEW = 48
"""Up to so many weights are sorted by insertion."""

_DIGIT = 11
"""Bits that one pass of sorting looks at."""


@_kernel
def predict(
    means: ndarray, covariances: ndarray, transition: ndarray, noises: ndarray
) -> tuple[ndarray, ndarray]:
    """F m and F P Fᵀ + Q of every component, symmetric to the last bit.

    Args:
        means: (J, d).
        covariances: (J, d, d).
        transition: F (d, d).
        noises: Q, (1, d, d) for all, or (J, d, d).
    """
    size, dimension = means.shape
    shared = noises.shape[0] == 1
    moved = np.empty((size, dimension))
    spread = np.empty((size, dimension, dimension))
    half = np.empty((dimension, dimension))
    for j in range(size):
        for a in range(dimension):
            total = 0.0
            for b in range(dimension):
                total += transition[a, b] * means[j, b]
            moved[j, a] = total
            for b in range(dimension):
                total = 0.0
                for c in range(dimension):
                    total += transition[a, c] * covariances[j, c, b]
                half[a, b] = total
        noise = 0 if shared else j
        for a in range(dimension):
            for b in range(a + 1):
                total = 0.5 * (noises[noise, a, b] + noises[noise, b, a])
                for c in range(dimension):
                    total += half[a, c] * transition[b, c]
                spread[j, a, b] = total
                spread[j, b, a] = total
    return moved, spread


@_kernel
def heaviest_first(weights: ndarray) -> ndarray:
    """Indices of weights (J,), none negative, heaviest first; of equal ones the first comes first.

    Few are sorted by insertion. Of many the bits are: those of a positive number are in the
    order of the numbers, so a pass for each eleven of them, from the lowest, does it.
    """
    size = len(weights)
    order = np.arange(size)
    if size <= _FEW:
        for k in range(1, size):
            i = order[k]
            place = k
            while place > 0 and weights[order[place - 1]] < weights[i]:
                order[place] = order[place - 1]
                place -= 1
            order[place] = i
        return order
    # a negative zero becomes a positive one; what is heavier becomes what is smaller
    keys = ~((weights + 0.0).view(np.uint64))
    other = np.empty(size, dtype=np.int64)
    mask = np.uint64((1 << _DIGIT) - 1)
    begins = np.empty((1 << _DIGIT) + 1, dtype=np.int64)
    for shift in range(0, 64, _DIGIT):
        places = np.uint64(shift)
        begins[:] = 0
        for i in range(size):
            begins[np.int64((keys[i] >> places) & mask) + 1] += 1
        if begins[np.int64((keys[0] >> places) & mask) + 1] == size:
            continue  # all agree
        for digit in range(1 << _DIGIT):
            begins[digit + 1] += begins[digit]
        for k in range(size):
            own = np.int64((keys[order[k]] >> places) & mask)
            other[begins[own]] = order[k]
            begins[own] += 1
        order, other = other, order
    return order


@_kernel
def heaviest_of_groups(weights: ndarray, group: ndarray, count: int) -> ndarray:
    """The heaviest of each group 0 … count - 1, of equal ones the last; -1 where it is empty."""
    heaviest = np.full(count, -1, dtype=np.int64)
    for i in range(len(weights)):
        best = heaviest[group[i]]
        if best < 0 or weights[i] >= weights[best]:
            heaviest[group[i]] = i
    return heaviest
