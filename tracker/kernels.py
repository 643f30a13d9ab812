"""The hot loops, compiled by numba: plain functions of arrays, called without the interpreter.

Every kernel has a NumPy or SciPy counterpart in the tests that it must agree with.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
import numpy as np
from numpy import ndarray

_F = TypeVar("_F", bound=Callable[..., Any])


def _kernel(function: _F) -> _F:
    """Compile on the first call, keep the machine code on disk, release the interpreter."""
    return cast(_F, numba.njit(cache=True, nogil=True)(function))


@_kernel
def factorise(matrix: ndarray, lower: ndarray) -> float:
    """Cholesky factor of a symmetric positive definite matrix, and its log determinant.

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


@_kernel
def solve(lower: ndarray, right: ndarray, solution: ndarray) -> None:
    """The vector x with L Lᵀ x = b, for a Cholesky factor L."""
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


@_kernel
def squared_length(residual: ndarray, lower: ndarray) -> float:
    """Squared Mahalanobis length of a vector, by the Cholesky factor of its covariance."""
    total, solved = 0.0, np.empty(len(residual))
    for p in range(len(residual)):
        value = residual[p]
        for r in range(p):
            value -= lower[p, r] * solved[r]
        solved[p] = value / lower[p, p]
        total += solved[p] * solved[p]
    return total


@_kernel
def merge_groups(
    means: ndarray, covariances: ndarray, order: ndarray, owners: ndarray, threshold: float
) -> tuple[ndarray, ndarray]:
    """Group components around the heaviest ones left.

    Args:
        means: (J, d).
        covariances: (J, d, d).
        order: (J,) indices, heaviest first.
        owners: (J,); a component with an owner (0 or more) joins its owner's only.
        threshold: Squared Mahalanobis distance.

    Returns:
        The group of each component (J,) and the leader of each group (K,).

    Raises:
        numpy.linalg.LinAlgError: If a covariance is not positive definite.
    """
    size, dimension = means.shape
    group = np.full(size, -1, dtype=np.int64)
    leaders = np.empty(size, dtype=np.int64)
    lower = np.zeros((size, dimension, dimension))
    for i in range(size):
        factorise(covariances[i], lower[i])
    offset = np.empty(dimension)
    count = 0
    for rank in range(size):
        leader = order[rank]
        if group[leader] >= 0:
            continue
        group[leader] = count
        for later in range(rank + 1, size):
            i = order[later]
            if group[i] >= 0 or (owners[i] >= 0 and owners[i] != owners[leader]):
                continue
            near = True
            for a in range(dimension):
                offset[a] = means[i, a] - means[leader, a]
                # no axis alone may be beyond the threshold
                if offset[a] * offset[a] > threshold * covariances[i, a, a]:
                    near = False
                    break
            if near and squared_length(offset, lower[i]) <= threshold:
                group[i] = count
        leaders[count] = leader
        count += 1
    return group, leaders[:count].copy()


@_kernel
def merge_moments(
    weights: ndarray, means: ndarray, covariances: ndarray, group: ndarray, count: int
) -> tuple[ndarray, ndarray, ndarray]:
    """Weight, mean and covariance (spread of the means included) of each group.

    In a group without any weight all count the same.
    """
    size, dimension = means.shape
    merged_weights = np.zeros(count)
    merged_means = np.zeros((count, dimension))
    merged_covariances = np.zeros((count, dimension, dimension))
    members = np.zeros(count)
    for i in range(size):
        merged_weights[group[i]] += weights[i]
        members[group[i]] += 1.0
    for i in range(size):
        g = group[i]
        share = weights[i] / merged_weights[g] if merged_weights[g] > 0.0 else 1.0 / members[g]
        for a in range(dimension):
            merged_means[g, a] += share * means[i, a]
    for i in range(size):
        g = group[i]
        share = weights[i] / merged_weights[g] if merged_weights[g] > 0.0 else 1.0 / members[g]
        for a in range(dimension):
            difference_a = means[i, a] - merged_means[g, a]
            for b in range(dimension):
                merged_covariances[g, a, b] += share * (
                    covariances[i, a, b] + difference_a * (means[i, b] - merged_means[g, b])
                )
    return merged_weights, merged_means, merged_covariances


@_kernel
def kalman_pairs(
    means: ndarray,
    covariances: ndarray,
    expected: ndarray,
    jacobians: ndarray,
    measurements: ndarray,
    noises: ndarray,
    spreads: ndarray,
    gate: float,
) -> tuple[ndarray, ndarray, ndarray, ndarray, ndarray]:
    """The Kalman update of every component by every measurement inside its gate.

    Args:
        means: (J, d).
        covariances: (J, d, d).
        expected: (J, m), the measurement each component predicts.
        jacobians: (J, m, d), its derivative H.
        measurements: (M, m).
        noises: (1, m, m) for all, or (M, m, m).
        spreads: (J, m, m), what a component adds to the noise, or (0, m, m) for nothing.
        gate: Squared Mahalanobis distance of the innovation; infinity for none.

    Returns:
        For each of the P pairs, measurement by measurement: component (P,),
        measurement (P,), log N(z; h, S) (P,), mean (P, d), covariance (P, d, d)
        in Joseph form, which stays symmetric and positive.

    Raises:
        numpy.linalg.LinAlgError: If the covariance of an innovation is not positive definite.
    """
    size, dimension = means.shape
    count, order = measurements.shape
    shared = noises.shape[0] == 1
    spread = spreads.shape[0] > 0
    ph = np.empty((size, dimension, order))
    own = np.empty((size, order, order))
    lower = np.empty((size, order, order))
    constants = np.empty(size)
    gains = np.empty((size, dimension, order))
    updated = np.empty((size, dimension, dimension))
    has_factor = np.zeros(size, dtype=np.bool_)
    has_gain = np.zeros(size, dtype=np.bool_)

    component = np.empty(size * count, dtype=np.int64)
    measured = np.empty(size * count, dtype=np.int64)
    likelihood = np.empty(size * count)
    new_means = np.empty((size * count, dimension))
    new_covariances = np.empty((size * count, dimension, dimension))

    factor = np.empty((dimension, dimension))
    half = np.empty((dimension, dimension))
    noise = np.empty((order, order))
    offset = np.empty(order)
    solved = np.empty(order)
    pairs = 0
    for z in range(count):
        for j in range(size):
            for p in range(order):
                for q in range(order):
                    noise[p, q] = noises[0 if shared else z, p, q]
                    if spread:
                        noise[p, q] += spreads[j, p, q]
            if z == 0:
                for a in range(dimension):
                    for p in range(order):
                        total = 0.0
                        for b in range(dimension):
                            total += covariances[j, a, b] * jacobians[j, p, b]
                        ph[j, a, p] = total
                # H P Hᵀ, the state's share of the innovation's covariance
                for p in range(order):
                    for q in range(p + 1):
                        total = 0.0
                        for a in range(dimension):
                            total += jacobians[j, p, a] * ph[j, a, q]
                        own[j, p, q] = total
            near = True
            for p in range(order):
                offset[p] = measurements[z, p] - expected[j, p]
                # no number of a measurement alone may be beyond the gate
                if offset[p] * offset[p] > gate * (noise[p, p] + own[j, p, p]):
                    near = False
            if not near:
                continue
            if not shared or not has_factor[j]:
                has_factor[j] = True
                # the Cholesky factor of S = H P Hᵀ + R
                for p in range(order):
                    for q in range(p + 1):
                        total = noise[p, q] + own[j, p, q]
                        for r in range(q):
                            total -= lower[j, p, r] * lower[j, q, r]
                        if p == q:
                            if not total > 0.0:
                                raise np.linalg.LinAlgError("H P H' + R is not positive definite")
                            lower[j, p, p] = math.sqrt(total)
                        else:
                            lower[j, p, q] = total / lower[j, q, q]
                constant = -0.5 * order * math.log(2.0 * math.pi)
                for p in range(order):
                    constant -= math.log(lower[j, p, p])
                constants[j] = constant
            distance = 0.0
            for p in range(order):
                total = offset[p]
                for r in range(p):
                    total -= lower[j, p, r] * solved[r]
                solved[p] = total / lower[j, p, p]
                distance += solved[p] * solved[p]
            if not distance <= gate or distance == math.inf:
                continue
            if not (shared and has_gain[j]):
                has_gain[j] = True
                # K = P Hᵀ S⁻¹, row by row through the factor
                for a in range(dimension):
                    for p in range(order):
                        total = ph[j, a, p]
                        for r in range(p):
                            total -= lower[j, p, r] * solved[r]
                        solved[p] = total / lower[j, p, p]
                    for p in range(order - 1, -1, -1):
                        total = solved[p]
                        for r in range(p + 1, order):
                            total -= lower[j, r, p] * gains[j, a, r]
                        gains[j, a, p] = total / lower[j, p, p]
                # P = (I - K H) P (I - K H)ᵀ + K R Kᵀ
                for a in range(dimension):
                    for b in range(dimension):
                        total = 1.0 if a == b else 0.0
                        for p in range(order):
                            total -= gains[j, a, p] * jacobians[j, p, b]
                        factor[a, b] = total
                for a in range(dimension):
                    for b in range(dimension):
                        total = 0.0
                        for c in range(dimension):
                            total += factor[a, c] * covariances[j, c, b]
                        half[a, b] = total
                for a in range(dimension):
                    for b in range(a + 1):
                        total = 0.0
                        for c in range(dimension):
                            total += half[a, c] * factor[b, c]
                        for p in range(order):
                            for q in range(order):
                                total += gains[j, a, p] * noise[p, q] * gains[j, b, q]
                        updated[j, a, b] = total
                        updated[j, b, a] = total
            component[pairs] = j
            measured[pairs] = z
            likelihood[pairs] = constants[j] - 0.5 * distance
            for a in range(dimension):
                total = means[j, a]
                for p in range(order):
                    total += gains[j, a, p] * offset[p]
                new_means[pairs, a] = total
                for b in range(dimension):
                    new_covariances[pairs, a, b] = updated[j, a, b]
            pairs += 1
    return (
        component[:pairs],
        measured[:pairs],
        likelihood[:pairs],
        new_means[:pairs],
        new_covariances[:pairs],
    )


@_kernel
def phd_weights(
    log_terms: ndarray, measured: ndarray, log_clutter: ndarray
) -> tuple[ndarray, ndarray, ndarray]:
    """Weights of a PHD update, in logarithms: a far measurement still goes to its nearest.

    Args:
        log_terms: (P,), log(p_D w q(z)) of each pair.
        measured: (P,), its measurement.
        log_clutter: (M,), log κ(z); minus infinity without clutter.

    Returns:
        (P,) weights; (P,) log odds against clutter; (M,) sums of the weights.
    """
    count = len(log_clutter)
    largest = np.empty(count)
    for z in range(count):
        largest[z] = max(log_clutter[z], -1e300)
    for pair in range(len(log_terms)):
        z = measured[pair]
        largest[z] = max(largest[z], log_terms[pair])
    totals = np.empty(count)
    for z in range(count):
        totals[z] = math.exp(log_clutter[z] - largest[z])
    weights = np.empty(len(log_terms))
    odds = np.empty(len(log_terms))
    for pair in range(len(log_terms)):
        z = measured[pair]
        weights[pair] = math.exp(log_terms[pair] - largest[z])
        totals[z] += weights[pair]
        odds[pair] = log_terms[pair] - log_clutter[z]
    sums = np.zeros(count)
    for pair in range(len(log_terms)):
        z = measured[pair]
        weights[pair] /= totals[z]
        sums[z] += weights[pair]
    return weights, odds, sums


@_kernel
def sum_pairs(
    labels: ndarray, cameras: ndarray, of_pairs: ndarray, boxes: ndarray, weights: ndarray
) -> tuple[ndarray, ndarray, ndarray, ndarray]:
    """Sum the pairs of one camera, component and box; pairs of absent labels are left out.

    Args:
        labels: (J,) of the components; of several with one label the first stands for it.
        cameras: (A,) of the pairs, as the further ones.
        of_pairs: (A,) labels.
        boxes: (A,).
        weights: (A,).

    Returns:
        (K,) camera, component, box and sum of each pair, in the order of these three.
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
    return rest // size, rest % size, found % width, sums[:distinct].copy()


@_kernel
def belief_propagation(
    missed: ndarray, detected: ndarray, unexplained: ndarray, tolerance: float, iterations: int
) -> tuple[ndarray, ndarray]:
    """Messages between targets and measurements until they settle.

    Args:
        missed: (n,) weight of each target's miss.
        detected: (n, M) weight of each pair, 0 outside the gate.
        unexplained: (M,) weight of each measurement being nobody's.
        tolerance: Largest change of a message at which to stop.
        iterations: At most this many.

    Returns:
        (n, 1 + M) probabilities of a miss and of each measurement for every target, and
        (M,) the probability that no target made the measurement.
    """
    targets, count = detected.shape
    to_target = np.empty((targets, count))
    to_measurement = np.zeros((targets, count))
    for j in range(count):
        for i in range(targets):
            to_target[i, j] = 1.0 / unexplained[j]
    for _ in range(iterations):
        for i in range(targets):
            total = missed[i]
            for j in range(count):
                total += detected[i, j] * to_target[i, j]
            for j in range(count):
                if detected[i, j] > 0.0:
                    rest = max(total - detected[i, j] * to_target[i, j], 1e-300)
                    to_measurement[i, j] = detected[i, j] / rest
        change = 0.0
        for j in range(count):
            total = unexplained[j]
            for i in range(targets):
                total += to_measurement[i, j]
            for i in range(targets):
                new = 1.0 / max(total - to_measurement[i, j], 1e-300)
                change = max(change, abs(new - to_target[i, j]) * unexplained[j])
                to_target[i, j] = new
        if change < tolerance:
            break
    rows = np.empty((targets, 1 + count))
    columns = np.empty(count)
    for i in range(targets):
        total = missed[i]
        rows[i, 0] = missed[i]
        for j in range(count):
            rows[i, 1 + j] = detected[i, j] * to_target[i, j]
            total += rows[i, 1 + j]
        for j in range(1 + count):
            rows[i, j] /= max(total, 1e-300)
    for j in range(count):
        total = unexplained[j]
        for i in range(targets):
            total += to_measurement[i, j]
        columns[j] = unexplained[j] / total
    return rows, columns
