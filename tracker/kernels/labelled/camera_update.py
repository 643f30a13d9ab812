"""What one camera's boxes say of everybody in a room, compiled: a labelled filter's inner step.

One call a camera and step: the calls between its parts would take longer than the parts.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tracker.kernels.association.belief_propagation import Settling
from tracker.kernels.boxes import Occlusion, hide, inside_probability
from tracker.kernels.compilation import kernel
from tracker.kernels.gating import Measurements
from tracker.kernels.intensity.phd import phd_update
from tracker.kernels.kalman import Expected
from tracker.kernels.labelled.marginals import bernoulli_update
from tracker.kernels.linear_algebra import Gaussians, merge_moments
from tracker.kernels.measurement import ExpectedBoxes


class Tracks(NamedTuple):
    """n Bernoulli tracks: one existence, one Gaussian and one label a person."""

    existences: ndarray
    """(n,)."""
    means: ndarray
    """(n, d)."""
    covariances: ndarray
    """(n, d, d)."""
    labels: ndarray
    """(n,)."""


class CameraRule(NamedTuple):
    """How every camera's boxes are taken."""

    gate: float
    """Squared Mahalanobis distance."""
    soft: bool
    """Of :func:`tracker.kernels.boxes.inside_probability`."""
    detection_probability: float
    """Of somebody in full view."""
    confirmed: float
    """Whoever occludes with more weight than this hides others."""
    near: float
    """As the next two, of :class:`tracker.kernels.boxes.Occlusion`."""
    strength: float
    worth_telling: float
    tolerance: float
    """As the next, of :class:`tracker.kernels.association.belief_propagation.Settling`."""
    iterations: int
    least_told: float
    """Association probability from which a pair is told."""


class CameraRecord(NamedTuple):
    """What a camera says of n tracks."""

    detection_probabilities: ndarray
    """(n,)."""
    hidden_by: ndarray
    """(n,), the label of who hides each, -1 for nobody."""
    sources: ndarray
    """(n,), the box that is more likely its own than any other and than none, -1 for none."""
    shares: ndarray
    """(n,), the probability of that."""


class Newcomers(NamedTuple):
    """What M boxes make of people never yet detected."""

    shares: ndarray
    """(M,), e / (κ + e): a newcomer's share in what no track explains."""
    means: ndarray
    """(M, d)."""
    covariances: ndarray
    """(M, d, d)."""


class TrackPairs(NamedTuple):
    """A pairs of a track and a box that are worth telling."""

    tracks: ndarray
    """(A,), the index."""
    boxes: ndarray
    """(A,)."""
    probabilities: ndarray
    """(A,)."""


class CameraUpdate(NamedTuple):
    """Everybody in a room after one camera's boxes."""

    existences: ndarray
    """(n,)."""
    means: ndarray
    """(n, d)."""
    covariances: ndarray
    """(n, d, d)."""
    record: CameraRecord
    undetected: ndarray
    """(U,), weights of those never yet detected."""
    newcomers: Newcomers
    unexplained: ndarray
    """(M,), the probability that no track made the box."""
    pairs: TrackPairs


@kernel
def _part(expected: Expected, first: int, last: int) -> Expected:
    """What the components from ``first`` to ``last``, exclusive, predict."""
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
    """The update of n tracks, and of the U people never yet detected, by one camera's M boxes.

    The undetected are updated as a PHD intensity; what a box makes of them, e, stands beside
    the clutter κ as what else may have made the box, and the tracks share the boxes by belief
    propagation. In what the camera expects, the undetected come first and then the tracks.

    Args:
        undetected: U components.
        tracks: n of them.
        occluding: (n,), the weight with which each track may hide others.
        measurements: M of them, each with its noise or all with one.
        seen: What the camera should see of U + n.
        image_size: (2,) width and height, pixels.
        clutter: κ (M,).
        resemblance: As :func:`tracker.kernels.labelled.marginals.bernoulli_update`.
        rule: How the boxes are taken.
    """
    size, count = len(undetected.weights), len(measurements.values)
    everybody = size + len(tracks.existences)
    expected, boxes, valid = seen.expected, seen.boxes, seen.valid
    jacobians = expected.jacobians
    new = phd_update(
        undetected,
        _part(expected, 0, size),
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
        Occlusion(rule.near, rule.strength, rule.worth_telling),
    )
    updated = bernoulli_update(
        Gaussians(tracks.existences, tracks.means, tracks.covariances),
        _part(expected, size, everybody),
        measurements,
        hidden.detection_probabilities,
        clutter / (1.0 - newcomer),
        resemblance,
        rule.gate,
        Settling(rule.tolerance, rule.iterations),
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
        _told(updated.rows, rule.least_told),
    )


class _Likeliest(NamedTuple):
    """The box that is more likely a track's own than any other and than none."""

    boxes: ndarray
    """(n,), -1 for none."""
    shares: ndarray
    """(n,), its probability."""


@kernel
def _likeliest(rows: ndarray) -> _Likeliest:
    """Of the association probabilities (n, 1 + M), of which the first is of a miss."""
    tracks, count = rows.shape
    best = np.full(tracks, -1, dtype=np.int64)
    shares = np.zeros(tracks)
    for i in range(tracks):
        for z in range(count - 1):
            if rows[i, 1 + z] > max(shares[i], rows[i, 0]):
                best[i], shares[i] = z, rows[i, 1 + z]
    return _Likeliest(best, shares)


@kernel
def _told(rows: ndarray, least: float) -> TrackPairs:
    """The pairs of (n, 1 + M) association probabilities that are not less than ``least``."""
    tracks, count = rows.shape
    who = np.empty(tracks * (count - 1), dtype=np.int64)
    what = np.empty(tracks * (count - 1), dtype=np.int64)
    probabilities = np.empty(tracks * (count - 1))
    told = 0
    for i in range(tracks):
        for z in range(count - 1):
            share = rows[i, 1 + z]
            if share > 0.0 and share >= least:
                who[told], what[told], probabilities[told] = i, z, share
                told += 1
    return TrackPairs(who[:told].copy(), what[:told].copy(), probabilities[:told].copy())
