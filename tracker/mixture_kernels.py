"""The hot loops over Gaussian mixtures of any size: predict, merge.

Merging does not look at every pair. Whatever lies within a squared Mahalanobis distance U
of a component with the covariance P lies within √(U P_aa) of it along every axis a: only
the cells of a grid over two axes that this box touches are searched, and what is too far
along another axis is left after one subtraction. The bounds are exact: the result is that
of comparing all.

[VM06] B.-N. Vo, W.-K. Ma, "The Gaussian mixture probability hypothesis density
filter", IEEE Transactions on Signal Processing 54(11), 2006.
"""

from __future__ import annotations

import math

import numpy as np
from numpy import ndarray

from tracker.kernels import _kernel

_CLASSES = 16
"""Components whose reach agrees within a factor of two share a grid: a few very wide ones do
not make the search wide for all."""

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


@_kernel
def _factors(covariances: ndarray) -> ndarray:
    """Cholesky factors (J, d, d) of covariances.

    Raises:
        numpy.linalg.LinAlgError: If one is not positive definite.
    """
    size, dimension = covariances.shape[:2]
    lower = np.empty((size, dimension, dimension))
    for i in range(size):
        for a in range(dimension):
            for b in range(a + 1):
                total = covariances[i, a, b]
                for c in range(b):
                    total -= lower[i, a, c] * lower[i, b, c]
                if a == b:
                    # what rounding leaves of a singular matrix is no variance
                    if not total > 1e-14 * covariances[i, a, a]:
                        raise np.linalg.LinAlgError("a covariance is not positive definite")
                    lower[i, a, a] = math.sqrt(total)
                else:
                    lower[i, a, b] = total / lower[i, b, b]
    return lower


@_kernel
def _widest_axes(means: ndarray, reach: ndarray) -> tuple[int, int]:
    """The two axes along which components lie furthest apart, measured by their mean reach."""
    size, dimension = means.shape
    first = second = 0
    most = more = -1.0
    for a in range(dimension):
        low = high = means[0, a]
        total = 0.0
        for i in range(size):
            low = min(low, means[i, a])
            high = max(high, means[i, a])
            total += reach[i, a]
        width = (high - low) / total
        if width > most:
            second, more = first, most
            first, most = a, width
        elif width > more:
            second, more = a, width
    return first, second


@_kernel
def _grids(
    means: ndarray, reach: ndarray, axes: tuple[int, int]
) -> tuple[ndarray, ndarray, ndarray, ndarray, ndarray]:
    """A grid over two axes for each class of reach, its cells about half as wide as the reach.

    Returns:
        The components cell by cell (J,); where each cell of all grids begins among them;
        for each class the first cell; rows and columns; and, (6), the lowest coordinate,
        the cell's size and the greatest reach along either axis. A class without
        components has no cells.
    """
    size = len(means)
    smallest = math.inf
    for i in range(size):
        smallest = min(smallest, reach[i, axes[0]])
    classes = np.empty(size, dtype=np.int64)
    members = np.zeros(_CLASSES, dtype=np.int64)
    low = np.full((_CLASSES, 2), math.inf)
    high = np.full((_CLASSES, 2), -math.inf)
    sides = np.zeros((_CLASSES, 6))
    for i in range(size):
        ratio = min(reach[i, axes[0]] / smallest, 1e12)
        c = min(int(math.log2(ratio)), _CLASSES - 1)
        classes[i] = c
        members[c] += 1
        for k in range(2):
            low[c, k] = min(low[c, k], means[i, axes[k]])
            high[c, k] = max(high[c, k], means[i, axes[k]])
            sides[c, 4 + k] = max(sides[c, 4 + k], reach[i, axes[k]])
    counts = np.zeros((_CLASSES, 2), dtype=np.int64)
    first_cell = np.zeros(_CLASSES + 1, dtype=np.int64)
    for c in range(_CLASSES):
        first_cell[c + 1] = first_cell[c]
        if members[c] == 0:
            continue
        fit = np.empty(2)
        for k in range(2):
            fit[k] = max(1.0, 2.0 * (high[c, k] - low[c, k]) / sides[c, 4 + k])
        # no more cells than a few a component, whatever the extent
        shrink = max(1.0, math.sqrt(fit[0] * fit[1] / (4.0 * members[c])))
        for k in range(2):
            counts[c, k] = max(1, min(int(fit[k] / shrink), 4 * members[c]))
            sides[c, k] = low[c, k]
            sides[c, 2 + k] = max((high[c, k] - low[c, k]) / counts[c, k], 0.5 * sides[c, 4 + k])
        first_cell[c + 1] += counts[c, 0] * counts[c, 1]
    begins = np.zeros(first_cell[_CLASSES] + 1, dtype=np.int64)
    cells = np.empty(size, dtype=np.int64)
    for i in range(size):
        c = classes[i]
        row = min(int((means[i, axes[0]] - low[c, 0]) / sides[c, 2]), counts[c, 0] - 1)
        column = min(int((means[i, axes[1]] - low[c, 1]) / sides[c, 3]), counts[c, 1] - 1)
        cells[i] = first_cell[c] + row * counts[c, 1] + column
        begins[cells[i] + 1] += 1
    for cell in range(len(begins) - 1):
        begins[cell + 1] += begins[cell]
    place = begins.copy()
    by_cell = np.empty(size, dtype=np.int64)
    for i in range(size):
        by_cell[place[cells[i]]] = i
        place[cells[i]] += 1
    return by_cell, begins, first_cell, counts, sides


@_kernel
def merge_groups(
    means: ndarray, covariances: ndarray, order: ndarray, owners: ndarray, threshold: float
) -> tuple[ndarray, ndarray]:
    """Group components around the heaviest ones left (Table II of [VM06]).

    A component i joins the leader l where (m_i − m_l)ᵀ P_i⁻¹ (m_i − m_l) <= threshold.

    Args:
        means: (J, d).
        covariances: (J, d, d), positive definite.
        order: (J,) indices, heaviest first.
        owners: (J,); a component with an owner (0 or more) joins its owner's only.
        threshold: Squared Mahalanobis distance.

    Returns:
        The group of each component (J,) and the leader of each group (K,).

    Raises:
        numpy.linalg.LinAlgError: If a covariance is not positive definite.
    """
    size, dimension = means.shape
    lower = _factors(covariances)
    group = np.full(size, -1, dtype=np.int64)
    leaders = np.empty(size, dtype=np.int64)
    if size == 0:
        return group, leaders
    reach = np.empty((size, dimension))
    for i in range(size):
        for a in range(dimension):
            # a little more than the bound, so that rounding excludes nobody
            reach[i, a] = math.sqrt(threshold * covariances[i, a, a]) * (1.0 + 1e-9) + 1e-300
    axes = _widest_axes(means, reach)
    by_cell, begins, first_cell, counts, sides = _grids(means, reach, axes)
    # place and reach along the grid's axes, in the order of the cells; nobody reaches out of -1
    beside = np.empty((size, 4))
    slot = np.empty(size, dtype=np.int64)
    for k in range(size):
        i = by_cell[k]
        slot[i] = k
        for axis in range(2):
            beside[k, axis] = means[i, axes[axis]]
            beside[k, 2 + axis] = reach[i, axes[axis]]
    solved = np.empty(dimension)
    from_cell = np.empty(2, dtype=np.int64)
    to_cell = np.empty(2, dtype=np.int64)
    count = 0
    for rank in range(size):
        leader = order[rank]
        if group[leader] >= 0:
            continue
        group[leader] = count
        beside[slot[leader], 2] = -1.0
        here = means[leader, axes[0]]
        there = means[leader, axes[1]]
        for c in range(_CLASSES):
            if first_cell[c + 1] == first_cell[c]:
                continue
            for k in range(2):
                offset = means[leader, axes[k]] - sides[c, k]
                low = (offset - sides[c, 4 + k]) / sides[c, 2 + k]
                high = (offset + sides[c, 4 + k]) / sides[c, 2 + k]
                from_cell[k] = int(max(0.0, min(low, counts[c, k])))
                to_cell[k] = int(max(-1.0, min(math.floor(high), counts[c, k] - 1.0)))
                # the last cell holds what lies on its far edge
                from_cell[k] = min(from_cell[k], counts[c, k] - 1)
            for row in range(from_cell[0], to_cell[0] + 1):
                cell = first_cell[c] + row * counts[c, 1]
                for k in range(begins[cell + from_cell[1]], begins[cell + to_cell[1] + 1]):
                    if (
                        abs(beside[k, 0] - here) > beside[k, 2]
                        or abs(beside[k, 1] - there) > beside[k, 3]
                    ):
                        continue
                    i = by_cell[k]
                    if owners[i] >= 0 and owners[i] != owners[leader]:
                        continue
                    near = True
                    for a in range(dimension):
                        if abs(means[i, a] - means[leader, a]) > reach[i, a]:
                            near = False
                            break
                    if not near:
                        continue
                    distance = 0.0
                    for a in range(dimension):
                        total = means[i, a] - means[leader, a]
                        for b in range(a):
                            total -= lower[i, a, b] * solved[b]
                        solved[a] = total / lower[i, a, a]
                        distance += solved[a] * solved[a]
                        if distance > threshold:
                            break
                    if distance <= threshold:
                        group[i] = count
                        beside[k, 2] = -1.0
        leaders[count] = leader
        count += 1
    return group, leaders[:count].copy()
