"""Marginal association probabilities by belief propagation, compiled.

The equations and their source are those of
:func:`tracker.filters.association.belief_propagation.marginals`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tracker.kernels.compilation import kernel


class Convergence(NamedTuple):
    """The criterion by which the iteration of the messages ends."""

    tolerance: float
    """Largest |Δν_ji| ρ_j at convergence: change of a message to a target, times the intensity of
    clutter and new targets at its measurement."""
    iterations: int
    """Largest number of iterations."""


class Marginals(NamedTuple):
    """Marginal association probabilities of n targets and M measurements."""

    rows: ndarray
    """(n, 1 + M), probabilities of a miss and of each measurement for every target."""
    unexplained: ndarray
    """(M,), probability that no target made the measurement."""


@kernel
def belief_propagation(
    missed: ndarray, detected: ndarray, unexplained: ndarray, convergence: Convergence
) -> Marginals:
    """Compute association marginals by messages between targets and measurements.

    Args:
        missed: w_i0 (n,), weight of each target being missed.
        detected: w_ij (n, M), weight of each target having made each measurement, 0 outside the
            gate.
        unexplained: ρ_j (M,), intensity of clutter and new targets at each measurement, > 0.
        convergence: The criterion of convergence.
    """
    targets, count = detected.shape
    # only pairs inside a gate exchange messages: listed row by row, with measurement and weight
    rows = np.zeros((targets, 1 + count))
    starts = np.zeros(targets + 1, dtype=np.int64)
    for i in range(targets):
        starts[i + 1] = starts[i]
        for j in range(count):
            if detected[i, j] > 0.0:
                starts[i + 1] += 1
    measured = np.empty(starts[targets], dtype=np.int64)
    weights = np.empty(starts[targets])
    to_target = np.empty(starts[targets])
    to_measurement = np.empty(starts[targets])
    pair = 0
    for i in range(targets):
        for j in range(count):
            if detected[i, j] > 0.0:
                measured[pair] = j
                weights[pair] = detected[i, j]
                to_target[pair] = 1.0 / unexplained[j]
                pair += 1
    totals = unexplained.copy()
    for _ in range(convergence.iterations):
        totals[:] = unexplained
        for i in range(targets):
            total = missed[i]
            for pair in range(starts[i], starts[i + 1]):
                total += weights[pair] * to_target[pair]
            for pair in range(starts[i], starts[i + 1]):
                rest = total - weights[pair] * to_target[pair]
                # where one pair has nearly all of the sum, the rest is rounding error
                if rest < 0.5 * missed[i]:
                    rest = missed[i]
                to_measurement[pair] = weights[pair] / max(rest, 1e-300)
                totals[measured[pair]] += to_measurement[pair]
        change = 0.0
        for pair in range(len(measured)):
            j = measured[pair]
            rest = totals[j] - to_measurement[pair]
            if rest < 0.5 * unexplained[j]:
                rest = unexplained[j]
            new = 1.0 / max(rest, 1e-300)
            change = max(change, abs(new - to_target[pair]) * unexplained[j])
            to_target[pair] = new
        if change < convergence.tolerance:
            break
    for i in range(targets):
        total = missed[i]
        for pair in range(starts[i], starts[i + 1]):
            total += weights[pair] * to_target[pair]
        total = max(total, 1e-300)
        rows[i, 0] = missed[i] / total
        for pair in range(starts[i], starts[i + 1]):
            rows[i, 1 + measured[pair]] = weights[pair] * to_target[pair] / total
    return Marginals(rows, unexplained / totals)
