"""Update of a labelled filter by the boxes of one camera, compiled.

One call for each camera and step: calls between its parts would take longer than the parts.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tracker.kernels.association.belief_propagation import Convergence
from tracker.kernels.boxes import Occlusion, hide, inside_probability
from tracker.kernels.compilation import kernel
from tracker.kernels.gating import Measurements
from tracker.kernels.intensity.phd import phd_update
from tracker.kernels.kalman import Expected
from tracker.kernels.labelled.marginals import bernoulli_update
from tracker.kernels.linear_algebra import Gaussians, merge_moments
from tracker.kernels.measurement import ExpectedBoxes


class Tracks(NamedTuple):
    """n Bernoulli tracks: an existence probability, a Gaussian and a label each."""

    existences: ndarray
    """(n,), existence probabilities."""
    means: ndarray
    """(n, d), states: position in metres, world frame, then velocity."""
    covariances: ndarray
    """(n, d, d), covariances."""
    labels: ndarray
    """(n,), labels."""


class CameraRule(NamedTuple):
    """Parameters of the update by any camera."""

    gate: float
    """Squared Mahalanobis distance of the gate."""
    soft: bool
    """Whether the edge of the image is soft: :func:`tracker.kernels.boxes.inside_probability`."""
    detection_probability: float
    """p_D of a target in full view."""
    confirmed: float
    """Weight above which a track occludes others."""
    near: float
    """This and the next two fields are those of :class:`tracker.kernels.boxes.Occlusion`."""
    strength: float
    reporting_share: float
    tolerance: float
    """This and the next field are those of
    :class:`tracker.kernels.association.belief_propagation.Convergence`."""
    iterations: int
    reporting_threshold: float
    """Association probability from which a pair is reported."""


class CameraRecord(NamedTuple):
    """The evidence of a camera for n tracks."""

    detection_probabilities: ndarray
    """(n,), p_D of each track."""
    hidden_by: ndarray
    """(n,), label of the occluder of each track, -1 for none."""
    sources: ndarray
    """(n,), index of the box that is likelier than any other and than a miss, -1 for none."""
    shares: ndarray
    """(n,), association probability of that box."""


class Newcomers(NamedTuple):
    """The components that M boxes make of targets never detected before."""

    shares: ndarray
    """(M,), e / (κ + e): share of new targets in the unexplained probability of the box."""
    means: ndarray
    """(M, d), states."""
    covariances: ndarray
    """(M, d, d), covariances."""


class TrackPairs(NamedTuple):
    """A pairs of a track and a box that are reported."""

    tracks: ndarray
    """(A,), index of the track."""
    boxes: ndarray
    """(A,), index of the box."""
    probabilities: ndarray
    """(A,), association probabilities."""


class CameraUpdate(NamedTuple):
    """Tracks and undetected targets after the update by one camera's boxes."""

    existences: ndarray
    """(n,), existence probabilities."""
    means: ndarray
    """(n, d), states."""
    covariances: ndarray
    """(n, d, d), covariances."""
    record: CameraRecord
    """The evidence of the camera for the n tracks."""
    undetected: ndarray
    """(U,), weights of the undetected components."""
    newcomers: Newcomers
    """The components that boxes make of undetected targets."""
    unexplained: ndarray
    """(M,), the probability that no track made each box."""
    pairs: TrackPairs
    """The pairs that are reported."""


@kernel
def _part(expected: Expected, count: int, last: int) -> Expected:
    """Select the predictions of the ``count`` components before the component ``last``."""
    first = last - count
    spreads, others = expected.spreads, len(expected.posture_values) > 0
    begin, end = (first, last) if others else (0, 0)
    return Expected(
        expected.values[first:last],
        expected.jacobians[first:last],
        spreads[first:last] if len(spreads) > 0 else spreads,
        expected.posture_values[begin:end],
        expected.posture_jacobians[begin:end],
        expected.posture_spreads[begin:end],
        expected.posture_drift,
        expected.posture_share,
    )


@kernel
def update_by_camera(
    undetected: Gaussians,
    tracks: Tracks,
    occluding: ndarray,
    measurements: Measurements,
    seen: ExpectedBoxes,
    image_size: ndarray,
    clutter: ndarray,
    resemblance: ndarray,
    rule: CameraRule,
) -> CameraUpdate:
    """Update n tracks and the U components of undetected targets by one camera's M boxes.

    The undetected targets are updated as a PHD intensity; its expected number of targets e at a
    box is added to the clutter κ, and the boxes are associated with the tracks by belief
    propagation. The predictions have the undetected components first and then the tracks.

    Args:
        undetected: U components.
        tracks: n tracks.
        occluding: (n,), the weight with which each track may occlude others.
        measurements: M boxes as measurements, each with its noise or all with one.
        seen: The predicted boxes of U + n components.
        image_size: (2,) width and height, pixels.
        clutter: κ (M,), per unit of the measurement space.
        resemblance: (n, M), an argument of
            :func:`tracker.kernels.labelled.marginals.bernoulli_update`.
        rule: The parameters of the update.
    """
    size, count = len(undetected.weights), len(measurements.values)
    everybody = size + len(tracks.existences)
    expected, boxes, valid = seen.expected, seen.boxes, seen.valid
    jacobians = expected.jacobians
    new = phd_update(
        undetected,
        _part(expected, size, size),
        measurements,
        rule.detection_probability
        * inside_probability(
            boxes[:size],
            jacobians[:size],
            undetected.covariances,
            valid[:size],
            image_size,
            rule.soft,
        ),
        clutter,
        rule.gate,
    )
    born = merge_moments(
        new.weights[size:], new.means[size:], new.covariances[size:], new.measured[size:], count
    )
    newcomer = np.minimum(new.sums, 1.0 - 1e-9)

    hiding = np.arange(0)
    if rule.strength > 0.0:
        hiding = np.flatnonzero(occluding > rule.confirmed)
    hidden = hide(
        rule.detection_probability
        * inside_probability(
            boxes[size:],
            jacobians[size:],
            tracks.covariances,
            valid[size:],
            image_size,
            rule.soft,
        ),
        boxes[size:],
        seen.depths[size:],
        tracks.means,
        tracks.labels,
        hiding,
        occluding[hiding],
        Occlusion(rule.near, rule.strength, rule.reporting_share),
    )
    updated = bernoulli_update(
        Gaussians(tracks.existences, tracks.means, tracks.covariances),
        _part(expected, everybody - size, everybody),
        measurements,
        hidden.detection_probabilities,
        clutter / (1.0 - newcomer),
        resemblance,
        rule.gate,
        Convergence(rule.tolerance, rule.iterations),
    )
    likeliest = _likeliest(updated.rows)
    return CameraUpdate(
        updated.existences,
        updated.means,
        updated.covariances,
        CameraRecord(
            hidden.detection_probabilities, hidden.hidden_by, likeliest.boxes, likeliest.shares
        ),
        new.weights[:size].copy(),
        Newcomers(newcomer, born.means, born.covariances),
        updated.unexplained,
        _reported_pairs(updated.rows, rule.reporting_threshold),
    )


class _Likeliest(NamedTuple):
    """The likeliest box of each of n tracks, where it is likelier than a miss."""

    boxes: ndarray
    """(n,), index of the box, -1 for none."""
    shares: ndarray
    """(n,), its association probability."""


@kernel
def _likeliest(rows: ndarray) -> _Likeliest:
    """Find the likeliest box of each row of (n, 1 + M) probabilities, the first being a miss."""
    tracks, count = rows.shape
    best = np.full(tracks, -1, dtype=np.int64)
    shares = np.zeros(tracks)
    for i in range(tracks):
        for z in range(count - 1):
            if rows[i, 1 + z] > max(shares[i], rows[i, 0]):
                best[i], shares[i] = z, rows[i, 1 + z]
    return _Likeliest(best, shares)


@kernel
def _reported_pairs(rows: ndarray, least: float) -> TrackPairs:
    """List the pairs of (n, 1 + M) association probabilities that are at least ``least``."""
    size, columns = rows.shape
    tracks = np.empty(size * (columns - 1), dtype=np.int64)
    boxes = np.empty(size * (columns - 1), dtype=np.int64)
    probabilities = np.empty(size * (columns - 1))
    count = 0
    for i in range(size):
        for z in range(columns - 1):
            share = rows[i, 1 + z]
            if share > 0.0 and share >= least:
                tracks[count], boxes[count], probabilities[count] = i, z, share
                count += 1
    return TrackPairs(tracks[:count].copy(), boxes[:count].copy(), probabilities[:count].copy())
