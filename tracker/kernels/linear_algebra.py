"""Kernels of linear algebra, grouping and duplicates, compiled.

Every kernel must agree with a NumPy or SciPy counterpart in the tests.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tracker.kernels.compilation import kernel


class Gaussians(NamedTuple):
    """J weighted Gaussians over a d-dimensional state."""

    weights: ndarray
    """(J,), expected numbers of targets."""
    means: ndarray
    """(J, d), states."""
    covariances: ndarray
    """(J, d, d), covariances."""


class LabelGroups(NamedTuple):
    """The groups of J components that share a label."""

    labels: ndarray
    """The distinct labels, ascending."""
    places: ndarray
    """(J,), index of each component's label among them."""


class SummedPairs(NamedTuple):
    """K pairs of a component and a box, in the order of camera, component and box."""

    cameras: ndarray
    """(K,) int32, index of the camera."""
    components: ndarray
    """(K,) int32, index of the component."""
    boxes: ndarray
    """(K,) int32, index of the box among the camera's boxes."""
    probabilities: ndarray
    """(K,) float32, association probabilities, at most 1."""


@kernel
def factorise(matrix: ndarray, lower: ndarray) -> float:
    """Compute the Cholesky factor of a symmetric positive definite matrix; returns log det.

    Raises:
        numpy.linalg.LinAlgError: If the matrix is not positive definite.
    """
    log_determinant = 0.0
    for p in range(len(matrix)):
        for q in range(p + 1):
            total = matrix[p, q]
            for r in range(q):
                total -= lower[p, r] * lower[q, r]
            if p == q:
                if not total > 0.0:
                    raise np.linalg.LinAlgError("a covariance is not positive definite")
                lower[p, p] = math.sqrt(total)
                log_determinant += math.log(total)
            else:
                lower[p, q] = total / lower[q, q]
    return log_determinant


@kernel
def solve(lower: ndarray, right: ndarray, solution: ndarray) -> None:
    """Solve L Lᵀ x = b for a Cholesky factor L."""
    size = len(lower)
    for p in range(size):
        total = right[p]
        for r in range(p):
            total -= lower[p, r] * solution[r]
        solution[p] = total / lower[p, p]
    for p in range(size - 1, -1, -1):
        total = solution[p]
        for r in range(p + 1, size):
            total -= lower[r, p] * solution[r]
        solution[p] = total / lower[p, p]


@kernel
def whiten(lower: ndarray, right: ndarray, whitened: ndarray) -> float:
    """Compute L⁻¹ b for a Cholesky factor L in place; returns its squared length."""
    length = 0.0
    for p in range(len(right)):
        value = right[p]
        for r in range(p):
            value -= lower[p, r] * whitened[r]
        value /= lower[p, p]
        whitened[p] = value
        length += value * value
    return length


@kernel
def squared_length(residual: ndarray, lower: ndarray) -> float:
    """The squared Mahalanobis length of a vector, by the Cholesky factor of its covariance."""
    return whiten(lower, residual, np.empty(len(residual)))


@kernel
def merge_moments(
    weights: ndarray, means: ndarray, covariances: ndarray, group: ndarray, count: int
) -> Gaussians:
    """Compute weight, mean and covariance (with the spread of the means) of each group.

    In a group without weight all components count equally. The group -1 is left out.
    """
    size, dimension = means.shape
    merged_weights = np.zeros(count)
    merged_means = np.zeros((count, dimension))
    merged_covariances = np.zeros((count, dimension, dimension))
    members = np.zeros(count)
    for i in range(size):
        if group[i] >= 0:
            merged_weights[group[i]] += weights[i]
            members[group[i]] += 1.0
    for i in range(size):
        g = group[i]
        if g < 0:
            continue
        share = weights[i] / merged_weights[g] if merged_weights[g] > 0.0 else 1.0 / members[g]
        for a in range(dimension):
            merged_means[g, a] += share * means[i, a]
    for i in range(size):
        g = group[i]
        if g < 0:
            continue
        share = weights[i] / merged_weights[g] if merged_weights[g] > 0.0 else 1.0 / members[g]
        for a in range(dimension):
            difference_a = means[i, a] - merged_means[g, a]
            for b in range(dimension):
                merged_covariances[g, a, b] += share * (
                    covariances[i, a, b] + difference_a * (means[i, b] - merged_means[g, b])
                )
    return Gaussians(merged_weights, merged_means, merged_covariances)


@kernel
def group_labels(labels: ndarray) -> LabelGroups:
    """Find the distinct labels, ascending, and the index of each of (J,) labels among them."""
    order = np.argsort(labels, kind="mergesort")
    distinct = np.empty(len(labels), dtype=np.int64)
    place = np.empty(len(labels), dtype=np.int64)
    count = 0
    for j in order:
        if count == 0 or labels[j] != distinct[count - 1]:
            distinct[count] = labels[j]
            count += 1
        place[j] = count - 1
    return LabelGroups(distinct[:count].copy(), place)


@kernel
def inside_bounds(points: ndarray, low: ndarray, high: ndarray) -> ndarray:
    """The indices of the points (N, d) whose first coordinates lie within bounds."""
    inside = np.empty(len(points), dtype=np.int64)
    count = 0
    for i in range(len(points)):
        within = True
        for axis in range(len(low)):
            within &= low[axis] <= points[i, axis] <= high[axis]
        if within:
            inside[count] = i
            count += 1
    return inside[:count].copy()


@kernel
def duplicates(
    means: ndarray,
    weights: ndarray,
    labels: ndarray,
    sources: ndarray,
    near: float,
    height: float,
    confirmed: float,
) -> ndarray:
    """Whether each of n tracks is a duplicate of a heavier or older one at the same place.

    Args:
        means: (n, d) states, position first, world metres.
        weights: (n,), existence of each track.
        labels: (n,); the smaller label is older.
        sources: (C, n), box of each track in each camera, -1 for none.
        near: Distance below which two are one, metres, unless some camera has a box for each; two
            on the floor within half of it are one even then, unless one is above the other.
        height: Vertical distance from which one is above the other, metres.
        confirmed: Weight above which a track is confirmed; an unconfirmed one never displaces it.
    """
    size, cameras = len(means), len(sources)
    duplicate = np.zeros(size, dtype=np.bool_)
    for i in range(size):
        for j in range(size):
            if i == j:
                continue
            sure, other_sure = weights[i] > confirmed, weights[j] > confirmed
            yields = labels[i] > labels[j] if sure == other_sure else other_sure
            if not yields:
                continue
            x, y, z = means[i, :3] - means[j, :3]
            on_floor = x * x + y * y
            if abs(z) < height and on_floor < (near / 2.0) ** 2:
                duplicate[i] = True
                break
            if not on_floor + z * z < near * near:
                continue
            parted = False
            for c in range(cameras):
                if sources[c, i] >= 0 and sources[c, j] >= 0 and sources[c, i] != sources[c, j]:
                    parted = True
            if not parted:
                duplicate[i] = True
                break
    return duplicate


@kernel
def sum_pairs(
    labels: ndarray, cameras: ndarray, of_pairs: ndarray, boxes: ndarray, weights: ndarray
) -> SummedPairs:
    """Sum the pairs of one camera, label and box; pairs of absent labels are left out.

    Args:
        labels: (J,), labels of the components; the first of several with one label represents it.
        cameras: (A,), camera of each pair.
        of_pairs: (A,), label of each pair, present or not.
        boxes: (A,), index of the box in its camera.
        weights: (A,), association probability of each pair.
    """
    count = len(of_pairs)
    width = 1
    for pair in range(count):
        width = max(width, boxes[pair] + 1)
    keys = np.empty(count, dtype=np.int64)
    kept = 0
    which = np.empty(count, dtype=np.int64)
    for pair in range(count):
        for component in range(len(labels)):
            if labels[component] == of_pairs[pair]:
                # camera, component and box as the digits of one number
                keys[kept] = (cameras[pair] * len(labels) + component) * width + boxes[pair]
                which[kept] = pair
                kept += 1
                break
    order = np.argsort(keys[:kept], kind="mergesort")
    found = np.empty(kept, dtype=np.int64)
    sums = np.zeros(kept)
    distinct = 0
    for place in order:
        if distinct == 0 or keys[place] != found[distinct - 1]:
            found[distinct] = keys[place]
            distinct += 1
        sums[distinct - 1] += weights[which[place]]
    found = found[:distinct]
    rest = found // width
    size = max(len(labels), 1)
    return SummedPairs(
        (rest // size).astype(np.int32),
        (rest % size).astype(np.int32),
        (found % width).astype(np.int32),
        np.minimum(sums[:distinct], 1.0).astype(np.float32),
    )
