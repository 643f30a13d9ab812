"""The hot loops over Gaussian mixtures of any size: predict, sort, pick; prune, merge, cap.

Merging does not compare every pair. Every point within a squared Mahalanobis distance U
of a component with the covariance P lies within √(U P_aa) of it along every axis a: only
the cells of a grid over two axes that this box touches are searched, and a component that is
too far along another axis is rejected after one subtraction. The bounds are exact: the result
is that of comparing all.

[VM06] B.-N. Vo, W.-K. Ma, "The Gaussian mixture probability hypothesis density
filter", IEEE Transactions on Signal Processing 54(11), 2006.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tracker.kernels.compilation import kernel
from tracker.kernels.linear_algebra import merge_moments

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
def nearest_components(
    positions: ndarray,
    position_starts: ndarray,
    weights: ndarray,
    means: ndarray,
    component_starts: ndarray,
    least_weight: float,
    radius: float,
) -> ndarray:
    """Find for each position the component that is nearest to it and to which it is nearest.

    Positions and components are compared within a step only; of equal distances the first counts.

    Args:
        positions: (R, 3), of all steps in turn, metres.
        position_starts: (S + 1,), index of the first position of each step, and R.
        weights: (J,), of the components of all steps in turn.
        means: (J, d), their states, which begin with the position, metres.
        component_starts: (S + 1,), index of the first component of each step, and J.
        least_weight: Weight that a component must exceed.
        radius: Largest distance between a position and its component, metres.

    Returns:
        (R,), index of the component among those of its step, -1 for none.
    """
    found = np.full(len(positions), -1, dtype=np.int64)
    for step in range(len(position_starts) - 1):
        for i in range(position_starts[step], position_starts[step + 1]):
            best, least = -1, math.inf
            for j in range(component_starts[step], component_starts[step + 1]):
                if weights[j] > least_weight:
                    distance = _squared_gap(positions[i], means[j])
                    if distance < least:
                        best, least = j, distance
            if best < 0 or least > radius * radius:
                continue
            nearest = True
            for k in range(position_starts[step], position_starts[step + 1]):
                distance = _squared_gap(positions[k], means[best])
                nearest = nearest and (least < distance or (least == distance and i <= k))
            if nearest:
                found[i] = best - component_starts[step]
    return found


@kernel
def _squared_gap(first: ndarray, second: ndarray) -> float:
    """The squared distance of two places, square metres."""
    x, y, z = first[0] - second[0], first[1] - second[1], first[2] - second[2]
    return float(x * x + y * y + z * z)


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


_CLASSES = 16
"""Number of grids. Components whose reach agrees within a factor of two share a grid, so that a few
very wide ones do not make the search wide for all."""


class Groups(NamedTuple):
    """J components grouped around K leaders."""

    places: ndarray
    """(J,), index of the group of each, -1 for none."""
    leaders: ndarray
    """(K,), the leader of each group."""


class Reduced(NamedTuple):
    """A mixture after pruning, merging and capping."""

    weights: ndarray
    """(K,), expected numbers of targets, heaviest first."""
    means: ndarray
    """(K, d), states."""
    covariances: ndarray
    """(K, d, d), covariances."""
    leaders: ndarray
    """(K,), index of the leader of each."""


class _Axes(NamedTuple):
    """Two axes of the state."""

    first: int
    second: int


class _Span(NamedTuple):
    """A range of cells, both ends included."""

    first: int
    last: int


class _Grids(NamedTuple):
    """A grid over two axes for each class of reach."""

    by_cell: ndarray
    """(N,), the components, cell by cell."""
    begins: ndarray
    """Index of the first component of each cell of all grids."""
    first_cell: ndarray
    """Index of the first cell of each class that has components, and one more."""
    counts: ndarray
    """Number of rows and columns of the grid of each such class."""
    sides: ndarray
    """(6,) for each such class: the lowest coordinate, the number of cells per metre and the
    greatest reach along either axis."""


@kernel
def _factor(covariances: ndarray, which: ndarray, lower: ndarray, axes: Sequence[int]) -> None:
    """Compute Cholesky factors of the covariances at ``which``, with 1 / L_aa for L_aa, in place.

    Args:
        axes: Axes of the state: a range, or a tuple of as many for unrolled loops.
    """
    for i in which:
        for a in range(len(axes)):
            for b in range(a):
                total = covariances[i, a, b]
                for c in range(b):
                    total -= lower[i, a, c] * lower[i, b, c]
                lower[i, a, b] = total * lower[i, b, b]
            total = covariances[i, a, a]
            for c in range(a):
                total -= lower[i, a, c] * lower[i, a, c]
            # rounding errors of a singular matrix are no variance
            if not total > 1e-14 * covariances[i, a, a]:
                raise np.linalg.LinAlgError("a covariance is not positive definite")
            lower[i, a, a] = 1.0 / math.sqrt(total)


@kernel
def _factors(covariances: ndarray, which: ndarray) -> ndarray:
    """Compute Cholesky factors (J, d, d) of covariances at ``which``, with 1 / L_aa for L_aa.

    Raises:
        numpy.linalg.LinAlgError: If one is not positive definite.
    """
    lower = np.empty(covariances.shape)
    dimension = covariances.shape[1]
    if dimension == 4:
        _factor(covariances, which, lower, (0, 1, 2, 3))
    else:
        _factor(covariances, which, lower, range(dimension))
    return lower


@kernel
def _widest_axes(means: ndarray, covariances: ndarray, which: ndarray) -> _Axes:
    """The two axes along which components are spread most, in units of their variances."""
    first = second = 0
    most = more = -1.0
    for a in range(means.shape[1]):
        low = high = means[which[0], a]
        total = 0.0
        for i in which:
            low = min(low, means[i, a])
            high = max(high, means[i, a])
            total += covariances[i, a, a]
        width = (high - low) ** 2 / total
        if width > most:
            second, more = first, most
            first, most = a, width
        elif width > more:
            second, more = a, width
    return _Axes(first, second)


@kernel
def _grids(places: ndarray) -> _Grids:
    """Make a grid over two axes for each class of reach, with cells of about half the reach.

    Args:
        places: (N, 4), the coordinates along the two axes and the reach along them, metres.
    """
    size = len(places)
    # the exponent of a floating-point number is the integer part of its logarithm
    classes = (places[:, 2] / places[:, 2].min()).view(np.int64) >> 52
    classes -= classes.min()
    members = np.zeros(_CLASSES, dtype=np.int64)
    low = np.full((_CLASSES, 2), math.inf)
    high = np.full((_CLASSES, 2), -math.inf)
    sides = np.zeros((_CLASSES, 6))
    for i in range(size):
        c = classes[i] = min(classes[i], _CLASSES - 1)
        members[c] += 1
        for k in range(2):
            low[c, k] = min(low[c, k], places[i, k])
            high[c, k] = max(high[c, k], places[i, k])
            sides[c, 4 + k] = max(sides[c, 4 + k], places[i, 2 + k])
    counts = np.zeros((_CLASSES, 2), dtype=np.int64)
    first_cell = np.zeros(_CLASSES + 1, dtype=np.int64)
    used = 0
    number = np.zeros(_CLASSES, dtype=np.int64)
    fit = np.empty(2)
    for c in range(_CLASSES):
        if members[c] == 0:
            continue
        for k in range(2):
            fit[k] = max(1.0, 2.0 * (high[c, k] - low[c, k]) / sides[c, 4 + k])
        # the number of cells is limited to a few per component, whatever the extent
        shrink = max(1.0, math.sqrt(fit[0] * fit[1] / (4.0 * members[c])))
        for k in range(2):
            counts[used, k] = max(1, min(int(fit[k] / shrink), 4 * members[c]))
            side = max((high[c, k] - low[c, k]) / counts[used, k], 0.5 * sides[c, 4 + k])
            sides[used, k] = low[c, k]
            sides[used, 2 + k] = 1.0 / side
            sides[used, 4 + k] = sides[c, 4 + k]
        first_cell[used + 1] = first_cell[used] + counts[used, 0] * counts[used, 1]
        number[c] = used
        used += 1
    begins = np.zeros(first_cell[used] + 1, dtype=np.int64)
    cells = np.empty(size, dtype=np.int64)
    for i in range(size):
        c = number[classes[i]]
        row = min(int((places[i, 0] - sides[c, 0]) * sides[c, 2]), counts[c, 0] - 1)
        column = min(int((places[i, 1] - sides[c, 1]) * sides[c, 3]), counts[c, 1] - 1)
        cells[i] = first_cell[c] + row * counts[c, 1] + column
        begins[cells[i] + 1] += 1
    for cell in range(len(begins) - 1):
        begins[cell + 1] += begins[cell]
    place = begins.copy()
    by_cell = np.empty(size, dtype=np.int64)
    for i in range(size):
        by_cell[place[cells[i]]] = i
        place[cells[i]] += 1
    return _Grids(by_cell, begins, first_cell[: used + 1], counts, sides)


@kernel
def _search(here: float, there: float, beside: ndarray, grids: _Grids, hits: ndarray) -> int:
    """Find the components that reach a place along both axes of the grids.

    Args:
        here: Coordinate along the first axis.
        there: Coordinate along the second axis.
        beside: (N, 4), as the places of :func:`_grids`, cell by cell. A component with a
            negative reach is not found.
        grids: The grids of these places.
        hits: (N + 1,), receives the rows of ``beside`` that are found.

    Returns:
        The number of rows found.
    """
    begins, first_cell = grids.begins, grids.first_cell
    counts, sides = grids.counts, grids.sides
    found = 0
    for c in range(len(first_cell) - 1):
        # a component that reaches the place lies in one of these cells; the last has its far edge
        rows = _reached(here - sides[c, 0], sides[c, 4], sides[c, 2], counts[c, 0])
        columns = _reached(there - sides[c, 1], sides[c, 5], sides[c, 3], counts[c, 1])
        for row in range(rows.first, rows.last + 1):
            cell = first_cell[c] + row * counts[c, 1]
            for k in range(begins[cell + columns.first], begins[cell + columns.last + 1]):
                # without a branch, which would be unpredictable
                hits[found] = k
                found += int(
                    (abs(beside[k, 0] - here) <= beside[k, 2])
                    & (abs(beside[k, 1] - there) <= beside[k, 3])
                )
    return found


@kernel
def _reached(offset: float, reach: float, cells_a_metre: float, count: int) -> _Span:
    """The first and the last of ``count`` cells in a row whose members may reach an offset."""
    first = min(max((offset - reach) * cells_a_metre - 1e-6, 0.0), count - 1.0)
    last = min(max((offset + reach) * cells_a_metre + 1e-6, -1.0), count - 1.0)
    return _Span(int(first), math.floor(last))


@kernel
def _squared_distance(
    means: ndarray, lower: ndarray, i: int, leader: int, solved: ndarray, axes: Sequence[int]
) -> float:
    """(m_i − m_l)ᵀ P_i⁻¹ (m_i − m_l), for a factor and axes of :func:`_factor`."""
    distance = 0.0
    for a in range(len(axes)):
        total = means[i, a] - means[leader, a]
        for b in range(a):
            total -= lower[i, a, b] * solved[b]
        solved[a] = total * lower[i, a, a]
        distance += solved[a] * solved[a]
    return distance


@kernel
def merge_groups(
    means: ndarray, covariances: ndarray, order: ndarray, owners: ndarray, threshold: float
) -> Groups:
    """Group components around the heaviest remaining ones (Table II of [VM06]).

    A component i joins the leader l where (m_i − m_l)ᵀ P_i⁻¹ (m_i − m_l) <= threshold.

    Args:
        means: (J, d), states.
        covariances: (J, d, d), positive definite.
        order: (N,), indices of the components to be grouped, heaviest first.
        owners: (J,), owner of each component, -1 for none; one with an owner (0 or more) joins
            components of the same owner only. (0,) where no component has one.
        threshold: Squared Mahalanobis distance U.

    Returns:
        The groups of the components in ``order``.

    Raises:
        numpy.linalg.LinAlgError: If a covariance is not positive definite.
    """
    dimension = means.shape[1]
    group = np.full(len(means), -1, dtype=np.int64)
    leaders = np.empty(len(order), dtype=np.int64)
    if len(order) == 0:
        return Groups(group, leaders)
    group[order] = -2
    which = np.flatnonzero(group == -2)
    lower = _factors(covariances, which)
    widest = _widest_axes(means, covariances, which)
    first, second = widest.first, widest.second
    places = np.empty((len(which), 4))
    # a little more than the bound, so that rounding excludes no component
    bound = threshold * (1.0 + 1e-9)
    for k in range(len(which)):
        i = which[k]
        places[k, 0], places[k, 1] = means[i, first], means[i, second]
        places[k, 2] = math.sqrt(bound * covariances[i, first, first]) + 1e-300
        places[k, 3] = math.sqrt(bound * covariances[i, second, second]) + 1e-300
    grids = _grids(places)
    by_cell = grids.by_cell
    # place and reach in the order of the cells; a reach of -1 reaches nothing
    beside = np.empty(places.shape)
    slot = np.empty(len(means), dtype=np.int64)
    for k in range(len(by_cell)):
        for side in range(4):
            beside[k, side] = places[by_cell[k], side]
        by_cell[k] = which[by_cell[k]]
        slot[by_cell[k]] = k
    hits = np.empty(len(which) + 1, dtype=np.int64)
    solved = np.empty(dimension)
    count = 0
    for leader in order:
        if group[leader] >= 0:
            continue
        group[leader] = count
        beside[slot[leader], 2] = -1.0
        found = _search(means[leader, first], means[leader, second], beside, grids, hits)
        for k in hits[:found]:
            i = by_cell[k]
            if len(owners) and owners[i] >= 0 and owners[i] != owners[leader]:
                continue
            if dimension == 4:
                distance = _squared_distance(means, lower, i, leader, solved, (0, 1, 2, 3))
            else:
                distance = _squared_distance(means, lower, i, leader, solved, range(dimension))
            if distance <= threshold:
                group[i] = count
                beside[k, 2] = -1.0
        leaders[count] = leader
        count += 1
    return Groups(group, leaders[:count].copy())


@kernel
def reduce_mixture(
    weights: ndarray,
    means: ndarray,
    covariances: ndarray,
    owners: ndarray,
    pruning_threshold: float,
    merging_threshold: float,
    max_components: int,
) -> Reduced:
    """Prune, merge and cap: :func:`tracker.filters.gaussian_mixture.reduce`.

    Only the moments of the remaining components are computed, and no array is moved in between.

    Args:
        weights: (J,), expected numbers of targets.
        means: (J, d), states.
        covariances: (J, d, d), covariances.
        owners: (J,), or (0,), as in :func:`merge_groups`.
        pruning_threshold: The least weight of a component.
        merging_threshold: Squared Mahalanobis distance U.
        max_components: Largest number of components.
    """
    kept = np.flatnonzero(weights >= pruning_threshold)
    order = kept[heaviest_first(weights[kept])]
    groups = merge_groups(means, covariances, order, owners, merging_threshold)
    group, leaders = groups.places, groups.leaders
    sums = np.zeros(len(leaders))
    for i in kept:
        sums[group[i]] += weights[i]
    heaviest = heaviest_first(sums)[:max_components]
    place = np.full(len(leaders), -1, dtype=np.int64)
    for k in range(len(heaviest)):
        place[heaviest[k]] = k
    for i in kept:
        group[i] = place[group[i]]
    merged = merge_moments(weights, means, covariances, group, len(heaviest))
    if len(heaviest) < len(leaders):
        merged.weights[:] *= sums.sum() / merged.weights.sum()
    return Reduced(merged.weights, merged.means, merged.covariances, leaders[heaviest])
