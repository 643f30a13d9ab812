"""One step of a labelled filter: update by the boxes of one camera, and of all, compiled.

One call for each step: calls between its parts would take longer than the parts.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tracker.kernels.association import Convergence
from tracker.kernels.bernoulli import bernoulli_update
from tracker.kernels.boxes import Occlusion, hide, inside_probability
from tracker.kernels.compilation import kernel
from tracker.kernels.kalman import Expected, Measurements
from tracker.kernels.lens import Calibrations, one_camera
from tracker.kernels.linear_algebra import Gaussians, duplicates, inside_bounds, merge_moments
from tracker.kernels.measurement import ExpectedBoxes, Target, expected_measurements, measured_boxes
from tracker.kernels.mixtures import heaviest_first, predict
from tracker.kernels.phd import phd_update


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
    :class:`tracker.kernels.association.Convergence`."""
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
    # spreads and postures may be none: of nothing any part is nothing
    return Expected(
        expected.values[first:last],
        expected.jacobians[first:last],
        expected.spreads[first:last],
        expected.posture_values[first:last],
        expected.posture_jacobians[first:last],
        expected.posture_spreads[first:last],
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
            :func:`tracker.kernels.bernoulli.bernoulli_update`.
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


class CameraBoxes(NamedTuple):
    """B boxes of C cameras, camera after camera."""

    boxes: ndarray
    """(B, 4) centre and half sizes, pixels."""
    sigmas: ndarray
    """(B, 4), standard deviations of the same four numbers, pixels."""
    starts: ndarray
    """(C + 1,), index of each camera's first box, and B."""
    clutter_factors: ndarray
    """(B,), factor on κ from each box's appearance: the larger, the likelier the box is false."""
    resemblance: ndarray
    """(n, B), likelihood ratio of each box's appearance for each track of the step before, of the
    track against any target; (0, B) where no track has an appearance."""


class StepModel(NamedTuple):
    """The model that is constant over the steps, beside target, cameras and update parameters."""

    transition: ndarray
    """F (d, d), transition matrix."""
    motion_noise: ndarray
    """Q (1, d, d), process noise of one step."""
    survival_probability: float
    birth_weights: ndarray
    """(G,), weights of the birth components, which are added to the undetected targets."""
    birth_means: ndarray
    """(G, d), states of the birth components."""
    birth_covariances: ndarray
    """(G, d, d), covariances of the birth components."""
    transform: ndarray
    """T (m, 4), an argument of :func:`tracker.kernels.measurement.measured_boxes`."""
    products: ndarray
    """(4, m²), an argument of :func:`tracker.kernels.measurement.measured_boxes`."""
    sigma_factor: float
    """Factor on the boxes' standard deviations."""
    clutter: ndarray
    """κ (C,), per unit of the measurement space."""
    least_existence: float
    """Least existence probability of a track that begins."""


class StepResult(NamedTuple):
    """n tracks, U undetected components, B boxes and A reported pairs after one step."""

    existences: ndarray
    """(n,), existence probabilities of the tracks."""
    means: ndarray
    """(n, d), states of the tracks."""
    covariances: ndarray
    """(n, d, d), covariances of the tracks."""
    labels: ndarray
    """(n,), labels of the tracks."""
    next_label: int
    """The first label that is free."""
    undetected_weights: ndarray
    """(U,), weights of the components of undetected targets."""
    undetected_means: ndarray
    """(U, d), states of the components of undetected targets."""
    undetected_covariances: ndarray
    """(U, d, d), covariances of the components of undetected targets."""
    detection_probabilities: ndarray
    """(C, n), for each camera a field of
    :class:`tracker.kernels.labelled.CameraRecord`; the next three fields have the
    same shape."""
    hidden_by: ndarray
    sources: ndarray
    shares: ndarray
    pair_cameras: ndarray
    """(A,), index of the camera of each reported pair."""
    pair_labels: ndarray
    """(A,), label of the track of each pair."""
    pair_boxes: ndarray
    """(A,), index of the box of each pair among the camera's boxes."""
    pair_probabilities: ndarray
    """(A,), association probability of each pair."""
    values: ndarray
    """(B, m), the boxes as measurements."""
    noises: ndarray
    """(B, m, m), covariances of the measurements."""
    unexplained: ndarray
    """(B,), the probability that no track made each box."""


class KeepingRule(NamedTuple):
    """Parameters by which tracks are retained at the end of a step."""

    least_existence: float
    """Existence probability below which a track is dropped."""
    low: ndarray
    """(3,), least coordinates of the volume in which tracks are retained, world metres."""
    high: ndarray
    """(3,), largest coordinates of the volume in which tracks are retained, world metres."""
    most: int
    """Largest number of tracks."""
    near: float
    """An argument of :func:`tracker.kernels.linear_algebra.duplicates`, as are ``height`` and
    ``confirmed``."""
    height: float
    confirmed: float


@kernel
def predict_and_update(
    tracks: Tracks,
    next_label: int,
    undetected: Gaussians,
    seen: CameraBoxes,
    model: StepModel,
    target: Target,
    cameras: Calibrations,
    rule: CameraRule,
) -> StepResult:
    """Predict n tracks and U undetected components, and update them by the boxes of C cameras.

    The cameras update in their order, each with :func:`update_by_camera`; a box of the
    undetected targets begins a track, which the cameras after it update.

    Args:
        tracks: The tracks of the step before.
        next_label: The first label that is free.
        undetected: The undetected components of the step before.
        seen: The boxes of the cameras.
        model: Motion, births and clutter.
        target: Sizes and postures of a target.
        cameras: The C cameras.
        rule: The parameters of the update.
    """
    starts, labels = seen.starts, tracks.labels
    count = len(seen.boxes)
    views = len(starts) - 1
    moved = predict(tracks.means, tracks.covariances, model.transition, model.motion_noise)
    means, covariances = moved.means, moved.covariances
    existences = tracks.existences * model.survival_probability
    waiting = predict(
        undetected.means, undetected.covariances, model.transition, model.motion_noise
    )
    left = np.concatenate((undetected.weights * model.survival_probability, model.birth_weights))
    undetected_means = np.concatenate((waiting.means, model.birth_means))
    undetected_covariances = np.concatenate((waiting.covariances, model.birth_covariances))
    measured = measured_boxes(
        seen.boxes, (model.sigma_factor * seen.sigmas) ** 2, model.transform, model.products
    )

    most = len(existences) + count
    occluding = np.zeros(most)
    for i in range(len(existences)):
        if existences[i] > rule.confirmed:
            occluding[i] = existences[i]
    detection_probabilities = np.zeros((views, most))
    shares = np.zeros((views, most))
    hidden_by = np.full((views, most), -1, dtype=np.int64)
    sources = np.full((views, most), -1, dtype=np.int64)
    unexplained = np.empty(count)
    capacity = 4 * most
    pair_rows = np.empty((capacity, 3), dtype=np.int64)
    probabilities = np.empty(capacity)
    pairs = 0
    for c in range(views):
        own = slice(starts[c], starts[c + 1])
        size = len(existences)
        camera = one_camera(cameras, c)
        found = update_by_camera(
            Gaussians(left, undetected_means, undetected_covariances),
            Tracks(existences, means, covariances, labels),
            occluding[:size],
            Measurements(measured.values[own], measured.noises[own]),
            expected_measurements(
                np.concatenate((undetected_means, means)),
                np.concatenate((undetected_covariances, covariances)),
                target,
                camera,
            ),
            camera.image_size,
            model.clutter[c] * seen.clutter_factors[own],
            np.ascontiguousarray(seen.resemblance[:, own]),
            rule,
        )
        existences, means, covariances = found.existences, found.means, found.covariances
        left = found.undetected
        unexplained[own] = found.unexplained
        record = found.record
        detection_probabilities[c, :size] = record.detection_probabilities
        hidden_by[c, :size] = record.hidden_by
        sources[c, :size], shares[c, :size] = record.sources, record.shares
        born_existences = unexplained[own] * found.newcomers.shares
        born = np.flatnonzero(born_existences > model.least_existence)
        known = found.pairs
        needed = pairs + len(known.tracks) + len(born)
        if needed > capacity:
            capacity = 2 * needed
            pair_rows = np.concatenate(
                (pair_rows, np.empty((capacity - len(pair_rows), 3), dtype=np.int64))
            )
            probabilities = np.concatenate((probabilities, np.empty(capacity - len(probabilities))))
        for pair in range(len(known.tracks)):
            pair_rows[pairs, 0], pair_rows[pairs, 1] = c, labels[known.tracks[pair]]
            pair_rows[pairs, 2] = known.boxes[pair]
            probabilities[pairs] = known.probabilities[pair]
            pairs += 1
        if len(born) == 0:
            continue
        for k in range(len(born)):
            z = born[k]
            detection_probabilities[c, size + k] = rule.detection_probability
            sources[c, size + k], shares[c, size + k] = z, 1.0
            if born_existences[z] >= rule.reporting_threshold:
                pair_rows[pairs, 0], pair_rows[pairs, 1], pair_rows[pairs, 2] = c, next_label + k, z
                probabilities[pairs] = born_existences[z]
                pairs += 1
        existences = np.concatenate((existences, born_existences[born]))
        means = np.concatenate((means, found.newcomers.means[born]))
        covariances = np.concatenate((covariances, found.newcomers.covariances[born]))
        labels = np.concatenate((labels, next_label + np.arange(len(born))))
        next_label += len(born)
    total = len(existences)
    return StepResult(
        existences,
        means,
        covariances,
        labels,
        next_label,
        left,
        undetected_means,
        undetected_covariances,
        detection_probabilities[:, :total].copy(),
        hidden_by[:, :total].copy(),
        sources[:, :total].copy(),
        shares[:, :total].copy(),
        pair_rows[:pairs, 0].copy(),
        pair_rows[:pairs, 1].copy(),
        pair_rows[:pairs, 2].copy(),
        probabilities[:pairs].copy(),
        measured.values,
        measured.noises,
        unexplained,
    )


@kernel
def kept_tracks(
    existences: ndarray, means: ndarray, labels: ndarray, sources: ndarray, rule: KeepingRule
) -> ndarray:
    """The indices of the tracks that are retained, by decreasing existence.

    Weak tracks, those outside the volume, duplicates, and those beyond the number are left out.

    Args:
        existences: (n,), existence probabilities.
        means: (n, d), states, position first, world metres.
        labels: (n,), labels of the tracks.
        sources: (C, n), box of each track in each camera, -1 for none.
        rule: The parameters.
    """
    alive = inside_bounds(means, rule.low, rule.high)
    alive = alive[existences[alive] >= rule.least_existence]
    order = alive[heaviest_first(existences[alive])][: rule.most]
    duplicate = duplicates(
        means[order],
        existences[order],
        labels[order],
        sources[:, order],
        rule.near,
        rule.height,
        rule.confirmed,
    )
    return np.asarray(order[~duplicate])
