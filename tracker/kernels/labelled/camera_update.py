"""What one camera's boxes say of everybody in a room, compiled: a labelled filter's inner step.

One call a camera and step: the calls between its parts would take longer than the parts.
"""

from __future__ import annotations

import numpy as np
from numpy import ndarray

from tracker.kernels.boxes import hide, inside_probability
from tracker.kernels.compilation import kernel
from tracker.kernels.intensity.phd import phd_update
from tracker.kernels.labelled.marginals import bernoulli_update
from tracker.kernels.linear_algebra import merge_moments


@kernel
def update_by_camera(
    undetected_weights: ndarray,
    undetected_means: ndarray,
    undetected_covariances: ndarray,
    existences: ndarray,
    means: ndarray,
    covariances: ndarray,
    labels: ndarray,
    occluding: ndarray,
    measurements: ndarray,
    noises: ndarray,
    clutter: float,
    gate: float,
    expected: ndarray,
    jacobians: ndarray,
    spreads: ndarray,
    boxes: ndarray,
    depths: ndarray,
    valid: ndarray,
    other_expected: ndarray,
    other_jacobians: ndarray,
    other_spreads: ndarray,
    other_drift: ndarray,
    other_share: float,
    image_size: tuple[int, int],
    soft: bool,
    detection_probability: float,
    confirmed: float,
    strength: float,
    near: float,
    least_covered: float,
    tolerance: float,
    iterations: int,
    least_told: float,
) -> tuple[
    ndarray, ndarray, ndarray, ndarray, ndarray, ndarray, ndarray, ndarray,
    ndarray, ndarray, ndarray, ndarray, ndarray, ndarray, ndarray,
]:  # fmt: skip
    """The update of n tracks, and of the U people never yet detected, by one camera's M boxes.

    The undetected are updated as a PHD intensity; what a box makes of them, e, stands beside
    the clutter κ as what else may have made the box, and the tracks share the boxes by belief
    propagation. In what the camera expects, the undetected come first and then the tracks.

    Args:
        undetected_weights: (U,), as the next two (U, d) and (U, d, d).
        existences: (n,), as the next two (n, d) and (n, d, d).
        labels: (n,).
        occluding: (n,), the weight with which each track may hide others.
        measurements: (M, m), as ``noises`` of :func:`tracker.kernels.kalman.kalman_pairs`.
        clutter: κ.
        gate: Squared Mahalanobis distance.
        expected: (U + n, m), as the further ones of :func:`tracker.kernels.boxes.expected_boxes`;
            ``spreads`` as there, or none.
        other_expected: As the further ones, of :func:`tracker.kernels.kalman.all_pairs`.
        image_size: As ``soft``, of :func:`tracker.kernels.boxes.inside_probability`.
        detection_probability: Of somebody in full view.
        confirmed: Whoever occludes with more weight than this hides others.
        strength: As the next two, of :func:`tracker.kernels.boxes.hide`.
        tolerance: As ``iterations``, of
            :func:`tracker.kernels.labelled.marginals.belief_propagation`.
        least_told: Association probability from which a pair is told.

    Returns:
        Of the tracks: (n,) existences, (n, d) means, (n, d, d) covariances; (n,) p_D and (n,)
        the label of who hides each; (n,) the box that is more likely its own than any other and
        than none, -1 for none, and (n,) its probability. Of the undetected: (U,) weights.
        Of the boxes: (M,) e / (κ + e), the share of a newcomer in what no track explains, his
        mean and covariance, and (M,) the probability that no track made it. Of the pairs worth
        telling: (A,) track, (A,) box and (A,) probability.
    """
    size, tracks, count = len(undetected_weights), len(existences), len(measurements)
    bends = len(spreads) > 0
    first = size if len(other_expected) > 0 else 0
    unseen = detection_probability * inside_probability(
        boxes[:size],
        jacobians[:size],
        undetected_covariances,
        valid[:size],
        image_size,
        soft,
    )
    weights, places, widths, _, sources, _, sums = phd_update(
        undetected_weights,
        undetected_means,
        undetected_covariances,
        expected[:size],
        jacobians[:size],
        measurements,
        noises,
        spreads[:size] if bends else spreads,
        unseen,
        np.full(count, clutter),
        gate,
        other_expected[:first],
        other_jacobians[:first],
        other_spreads[:first],
        other_drift,
        other_share,
    )
    _, born_means, born_covariances = merge_moments(
        weights[size:], places[size:], widths[size:], sources[size:], count
    )
    newcomer = np.minimum(sums, 1.0 - 1e-9)

    hiding = np.flatnonzero(occluding > confirmed) if strength > 0.0 else np.arange(0)
    chances, hidden_by = hide(
        detection_probability
        * inside_probability(
            boxes[size:], jacobians[size:], covariances, valid[size:], image_size, soft
        ),
        boxes[size:],
        depths[size:],
        means,
        labels,
        hiding,
        occluding[hiding],
        near,
        strength,
        least_covered,
    )
    existing, new_means, new_covariances, rows, unexplained = bernoulli_update(
        existences,
        means,
        covariances,
        expected[size:],
        jacobians[size:],
        measurements,
        noises,
        spreads[size:] if bends else spreads,
        chances,
        clutter / (1.0 - newcomer),
        gate,
        other_expected[first:],
        other_jacobians[first:],
        other_spreads[first:],
        other_drift,
        other_share,
        tolerance,
        iterations,
    )

    best = np.full(tracks, -1, dtype=np.int64)
    shares = np.zeros(tracks)
    who = np.empty(tracks * count, dtype=np.int64)
    what = np.empty(tracks * count, dtype=np.int64)
    chance = np.empty(tracks * count)
    told = 0
    for i in range(tracks):
        for z in range(count):
            share = rows[i, 1 + z]
            if share > max(shares[i], rows[i, 0]):
                best[i], shares[i] = z, share
            if share > 0.0 and share >= least_told:
                who[told], what[told], chance[told] = i, z, share
                told += 1
    return (
        existing, new_means, new_covariances, chances, hidden_by, best, shares,
        weights[:size].copy(), newcomer, born_means, born_covariances, unexplained,
        who[:told].copy(), what[:told].copy(), chance[:told].copy(),
    )  # fmt: skip
