"""What one camera's boxes say of everybody in a room, compiled: a labelled filter's inner step.

One call a camera and step: the calls between its parts would take longer than the parts.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tracker.kernels.association.belief_propagation import Settling
from tracker.kernels.boxes import Occluders, Occlusion, hide, inside_probability
from tracker.kernels.compilation import kernel
from tracker.kernels.gating import Measurements
from tracker.kernels.intensity.phd import phd_update
from tracker.kernels.kalman import Alternative, Expected
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


class CameraModel(NamedTuple):
    """How every camera's boxes are taken."""

    gate: float
    """Squared Mahalanobis distance."""
    soft: bool
    """Of :func:`tracker.kernels.boxes.inside_probability`."""
    detection_probability: float
    """Of somebody in full view."""
    confirmed: float
    """Whoever occludes with more weight than this hides others."""
    occlusion: Occlusion
    settling: Settling
    """Of the belief propagation."""
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

    tracks: Gaussians
    """Weights are existence probabilities."""
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
    spreads = expected.spreads
    return Expected(
        expected.values[first:last],
        expected.jacobians[first:last],
        spreads[first:last] if len(spreads) > 0 else spreads,
    )


@kernel
def update_by_camera(
    undetected: Gaussians,
    tracks: Tracks,
    occluding: ndarray,
    measurements: Measurements,
    expected: ExpectedBoxes,
    image_size: ndarray,
    clutter: float,
    model: CameraModel,
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
        expected: Of U + n.
        image_size: (2,) width and height, pixels.
        clutter: κ.
        model: How the boxes are taken.
    """
    size, count = len(undetected.weights), len(measurements.values)
    everybody = size + len(tracks.existences)
    posture = expected.posture
    other = posture.expected
    boxes, valid, jacobians = expected.boxes, expected.valid, expected.upright.jacobians
    first = size if len(other.values) > 0 else 0
    last = everybody if len(other.values) > 0 else 0
    new = phd_update(
        undetected,
        _part(expected.upright, 0, size),
        measurements,
        model.detection_probability
        * inside_probability(
            boxes[:size],
            jacobians[:size],
            undetected.covariances,
            valid[:size],
            image_size,
            model.soft,
        ),
        np.full(count, clutter),
        model.gate,
        Alternative(_part(other, 0, first), posture.drift, posture.share),
    )
    components = new.components
    born = merge_moments(
        components.weights[size:],
        components.means[size:],
        components.covariances[size:],
        new.measured[size:],
        count,
    )
    newcomer = np.minimum(new.sums, 1.0 - 1e-9)

    hiding = np.arange(0)
    if model.occlusion.strength > 0.0:
        hiding = np.flatnonzero(occluding > model.confirmed)
    seen = hide(
        model.detection_probability
        * inside_probability(
            boxes[size:],
            jacobians[size:],
            tracks.covariances,
            valid[size:],
            image_size,
            model.soft,
        ),
        boxes[size:],
        expected.depths[size:],
        tracks.means,
        tracks.labels,
        Occluders(hiding, occluding[hiding]),
        model.occlusion,
    )
    updated = bernoulli_update(
        Gaussians(tracks.existences, tracks.means, tracks.covariances),
        _part(expected.upright, size, everybody),
        measurements,
        seen.detection_probabilities,
        clutter / (1.0 - newcomer),
        model.gate,
        Alternative(_part(other, first, last), posture.drift, posture.share),
        model.settling,
    )
    rows = updated.marginals.rows
    likeliest = _likeliest(rows)
    return CameraUpdate(
        updated.tracks,
        CameraRecord(
            seen.detection_probabilities, seen.hidden_by, likeliest.boxes, likeliest.shares
        ),
        components.weights[:size].copy(),
        Newcomers(newcomer, born.means, born.covariances),
        updated.marginals.unexplained,
        _told(rows, model.least_told),
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
