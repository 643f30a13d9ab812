"""The Kalman update of all components by all measurements in their gates, compiled."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tracker.kernels.compilation import kernel
from tracker.kernels.gating import factor_innovation, gated_pairs


class Alternative(NamedTuple):
    """What else a measurement of J components may be: that of a target in another posture."""

    expected: ndarray
    """(J, m), or (0, m) where there is no other posture; as the next two."""
    jacobians: ndarray
    """(J, m, d)."""
    spreads: ndarray
    """(J, m, m), what the posture adds to the noise."""
    drift: ndarray
    """(d, d), how far a state may have moved with the change of posture: a covariance."""
    share: float
    """Of the measurements, above 0 and below 1."""

    @staticmethod
    def none(size: int, dimension: int) -> Alternative:
        """There is no other posture."""
        return Alternative(
            np.zeros((0, size)),
            np.zeros((0, size, dimension)),
            np.zeros((0, size, size)),
            np.zeros((dimension, dimension)),
            0.0,
        )


@kernel
def _innovations(
    covariances: ndarray,
    jacobians: ndarray,
    spreads: ndarray,
    axes: Sequence[int],
    rows: Sequence[int],
) -> tuple[ndarray, ndarray]:
    """P Hᵀ (J, d, m) and H P Hᵀ + Ω (J, m, m), what a component adds to the noise.

    Args:
        axes: Of the state: a range, or, so that loops are unrolled, a tuple of as many.
        rows: Of the measurement, likewise.
    """
    size = len(covariances)
    ph = np.empty((size, len(axes), len(rows)))
    own = np.empty((size, len(rows), len(rows)))
    for j in range(size):
        h = 0 if len(jacobians) == 1 else j
        for a in range(len(axes)):
            for p in range(len(rows)):
                total = 0.0
                for b in range(len(axes)):
                    total += covariances[j, a, b] * jacobians[h, p, b]
                ph[j, a, p] = total
        for p in range(len(rows)):
            for q in range(len(rows)):
                total = spreads[j, p, q] if len(spreads) else 0.0
                for a in range(len(axes)):
                    total += jacobians[h, p, a] * ph[j, a, q]
                own[j, p, q] = total
    return ph, own


@kernel
def _gain(
    j: int,
    n: int,
    ph: ndarray,
    lower: ndarray,
    factored: int,
    covariances: ndarray,
    jacobians: ndarray,
    noises: ndarray,
    spreads: ndarray,
    gains: ndarray,
    updated: ndarray,
    place: int,
    work: tuple[ndarray, ndarray, ndarray, ndarray],
    axes: Sequence[int],
    rows: Sequence[int],
) -> None:
    """K into ``gains[place]`` and (I − K H) P (I − K H)ᵀ + K R Kᵀ into ``updated[place]``.

    Args:
        j: The component.
        n: The noise.
        factored: Where the factor of S is in ``lower``.
        work: (m, m), twice (d, d), and (d, m), to write in.
        axes: As ``rows``, of :func:`_innovations`.
    """
    noise, factor, half, noisy = work
    h = 0 if len(jacobians) == 1 else j
    for p in range(len(rows)):
        for q in range(len(rows)):
            noise[p, q] = noises[n, p, q]
            if len(spreads):
                noise[p, q] += spreads[j, p, q]
    # K = P Hᵀ S⁻¹, row by row through the factor
    for a in range(len(axes)):
        for p in range(len(rows)):
            total = ph[j, a, p]
            for r in range(p):
                total -= lower[factored, p, r] * gains[place, a, r]
            gains[place, a, p] = total * lower[factored, p, p]
        for p in range(len(rows) - 1, -1, -1):
            total = gains[place, a, p]
            for r in range(p + 1, len(rows)):
                total -= lower[factored, r, p] * gains[place, a, r]
            gains[place, a, p] = total * lower[factored, p, p]
    for a in range(len(axes)):
        for b in range(len(axes)):
            total = 1.0 if a == b else 0.0
            for p in range(len(rows)):
                total -= gains[place, a, p] * jacobians[h, p, b]
            factor[a, b] = total
        for p in range(len(rows)):
            total = 0.0
            for q in range(len(rows)):
                total += gains[place, a, q] * noise[q, p]
            noisy[a, p] = total
    for a in range(len(axes)):
        for b in range(len(axes)):
            total = 0.0
            for c in range(len(axes)):
                total += factor[a, c] * covariances[j, c, b]
            half[a, b] = total
    for a in range(len(axes)):
        for b in range(a + 1):
            total = 0.0
            for c in range(len(axes)):
                total += half[a, c] * factor[b, c]
            for p in range(len(rows)):
                total += noisy[a, p] * gains[place, b, p]
            updated[place, a, b] = total
            updated[place, b, a] = total


@kernel
def _updated(
    component: ndarray,
    measured: ndarray,
    ph: ndarray,
    own: ndarray,
    lower: ndarray,
    means: ndarray,
    covariances: ndarray,
    expected: ndarray,
    jacobians: ndarray,
    measurements: ndarray,
    noises: ndarray,
    spreads: ndarray,
    axes: Sequence[int],
    rows: Sequence[int],
) -> tuple[ndarray, ndarray]:
    """Means (P, d) and covariances (P, d, d) of pairs."""
    pairs = len(component)
    dimension = len(axes)
    new_means = np.empty((pairs, dimension))
    new_covariances = np.empty((pairs, dimension, dimension))
    # with one noise for all, the pairs of a component share gain and covariance
    shared = len(noises) == 1
    known = np.zeros(len(means), dtype=np.bool_)
    known[component] = True
    filtered = np.flatnonzero(known) if shared else component
    places = len(means) if shared else pairs
    gains = np.empty((places, dimension, len(rows)))
    updated = np.empty((places, dimension, dimension))
    work = (
        np.empty((len(rows), len(rows))),
        np.empty((dimension, dimension)),
        np.empty((dimension, dimension)),
        np.empty((dimension, len(rows))),
    )
    for k in range(len(filtered)):
        j = filtered[k]
        n, place, factored = (0, j, j) if shared else (measured[k], k, 0)
        if not shared:
            factor_innovation(own, j, noises, n, lower, factored, rows)
        _gain(
            j, n, ph, lower, factored, covariances, jacobians, noises, spreads,
            gains, updated, place, work, axes, rows,
        )  # fmt: skip
    for pair in range(pairs):
        j, z = component[pair], measured[pair]
        place = j if shared else pair
        for a in range(len(axes)):
            total = means[j, a]
            for p in range(len(rows)):
                total += gains[place, a, p] * (measurements[z, p] - expected[j, p])
            new_means[pair, a] = total
            for b in range(len(axes)):
                new_covariances[pair, a, b] = updated[place, a, b]
    return new_means, new_covariances


@kernel
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
        jacobians: (J, m, d), its derivative H, or (1, m, d), one for all.
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
    dimension, order = means.shape[1], measurements.shape[1]
    # places in the plane and velocities are so frequent that their loops are unrolled
    plane = dimension == 4 and order == 2
    if plane:
        ph, own = _innovations(covariances, jacobians, spreads, (0, 1, 2, 3), (0, 1))
    else:
        ph, own = _innovations(covariances, jacobians, spreads, range(dimension), range(order))
    lower = np.empty((len(means) if len(noises) == 1 else 1, order, order))
    component, measured, likelihood = gated_pairs(expected, measurements, noises, own, gate, lower)
    if plane:
        new_means, new_covariances = _updated(
            component, measured, ph, own, lower, means, covariances, expected, jacobians,
            measurements, noises, spreads, (0, 1, 2, 3), (0, 1),
        )  # fmt: skip
    else:
        new_means, new_covariances = _updated(
            component, measured, ph, own, lower, means, covariances, expected, jacobians,
            measurements, noises, spreads, range(dimension), range(order),
        )  # fmt: skip
    return component, measured, likelihood, new_means, new_covariances


@kernel
def all_pairs(
    means: ndarray,
    covariances: ndarray,
    expected: ndarray,
    jacobians: ndarray,
    measurements: ndarray,
    noises: ndarray,
    spreads: ndarray,
    gate: float,
    other_expected: ndarray,
    other_jacobians: ndarray,
    other_spreads: ndarray,
    other_drift: ndarray,
    other_share: float,
) -> tuple[ndarray, ndarray, ndarray, ndarray, ndarray]:
    """:func:`kalman_pairs` of a measurement that is of one of two kinds.

        g(z|x) = (1 − ε) N(z; h(x), R + Ω) + ε N(z; h'(x'), R + Ω'),  x' = x + N(0, D)

    Args:
        means: As the further ones, of :func:`kalman_pairs`.
        other_expected: h' and, in the further ones, H', Ω', D and ε: :class:`Alternative`.

    Returns:
        The pairs of the first kind and then those of the other.
    """
    component, measured, likelihood, new_means, new_covariances = kalman_pairs(
        means, covariances, expected, jacobians, measurements, noises, spreads, gate
    )
    if len(other_expected) == 0:
        return component, measured, likelihood, new_means, new_covariances
    more = kalman_pairs(
        means,
        covariances + other_drift,
        other_expected,
        other_jacobians,
        measurements,
        noises,
        other_spreads,
        gate,
    )
    return (
        np.concatenate((component, more[0])),
        np.concatenate((measured, more[1])),
        np.concatenate((likelihood + math.log(1.0 - other_share), more[2] + math.log(other_share))),
        np.concatenate((new_means, more[3])),
        np.concatenate((new_covariances, more[4])),
    )
