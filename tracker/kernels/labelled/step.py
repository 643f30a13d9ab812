"""One step of the labelled filter over all cameras, compiled.

One call a step: the calls between its parts would take longer than the parts.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tracker.kernels.compilation import kernel
from tracker.kernels.gating import Measurements
from tracker.kernels.intensity.mixture import heaviest_first, predict
from tracker.kernels.labelled.camera_update import CameraRule, Tracks, update_by_camera
from tracker.kernels.lens import Calibrations, one_camera
from tracker.kernels.linear_algebra import Gaussians, duplicates, inside_bounds
from tracker.kernels.measurement import Target, expected_measurements, measured_boxes


class CameraBoxes(NamedTuple):
    """B boxes of C cameras, one camera after another."""

    boxes: ndarray
    """(B, 4) centre and half sizes, pixels."""
    sigmas: ndarray
    """(B, 4), standard deviations of the same, pixels."""
    starts: ndarray
    """(C + 1,), where each camera's boxes begin, and the end."""
    clutter_factors: ndarray
    """(B,), on κ: by what each looks like, it is the likelier false the larger this is."""
    resemblance: ndarray
    """(n, B), by how much likelier each track of the step before is to look as each box does than
    anybody; (0, B) where nothing is known of looks."""


class StepModel(NamedTuple):
    """What stays from step to step, beside target, cameras and how their boxes are taken."""

    transition: ndarray
    """F (d, d)."""
    motion_noise: ndarray
    """Q (1, d, d)."""
    survival_probability: float
    birth_weights: ndarray
    """(G,), as the next two (G, d) and (G, d, d): births join the undetected."""
    birth_means: ndarray
    birth_covariances: ndarray
    transform: ndarray
    """As ``products``, of :func:`tracker.kernels.measurement.measured_boxes`."""
    products: ndarray
    sigma_factor: float
    """On the boxes' standard deviations."""
    clutter: ndarray
    """κ (C,)."""
    least_existence: float
    """Of a track that begins."""


class StepResult(NamedTuple):
    """n tracks, U undetected people, B boxes and A pairs worth telling after one step."""

    existences: ndarray
    """(n,), as the next (n, d), (n, d, d) and (n,) of the tracks."""
    means: ndarray
    covariances: ndarray
    labels: ndarray
    next_label: int
    """The first that is free."""
    undetected_weights: ndarray
    """(U,), as the next two (U, d) and (U, d, d)."""
    undetected_means: ndarray
    undetected_covariances: ndarray
    detection_probabilities: ndarray
    """(C, n), as the next three: of each camera the fields of
    :class:`tracker.kernels.labelled.camera_update.CameraRecord`."""
    hidden_by: ndarray
    sources: ndarray
    shares: ndarray
    pair_cameras: ndarray
    """(A,), as the next three: of the pairs camera, label, box and probability."""
    pair_labels: ndarray
    pair_boxes: ndarray
    pair_probabilities: ndarray
    values: ndarray
    """(B, m), the boxes as measurements, and (B, m, m) their noises."""
    noises: ndarray
    unexplained: ndarray
    """(B,), the probability that no track made each."""


class KeepingRule(NamedTuple):
    """Which tracks live on."""

    least_existence: float
    """Who has less is dropped."""
    low: ndarray
    """(3,), as ``high``, the corners that a track stays between, world metres."""
    high: ndarray
    most: int
    """No more than this are kept."""
    near: float
    """As ``height`` and ``confirmed``, of :func:`tracker.kernels.linear_algebra.duplicates`."""
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
    """Predict n tracks and the U people never yet detected, update them by C cameras' boxes.

    Camera after camera, in their order, each with :func:`update_by_camera`; what a box makes of
    the undetected begins a track, which the cameras after it update.

    Args:
        tracks: Of the step before.
        next_label: The first that is free.
        undetected: Of the step before.
        seen: What the cameras show.
        model: Of the room and how people move in it.
        target: Of their size and postures.
        cameras: C of them.
        rule: How their boxes are taken.
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
    told = np.empty((capacity, 3), dtype=np.int64)
    told_probabilities = np.empty(capacity)
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
            told = np.concatenate((told, np.empty((capacity - len(told), 3), dtype=np.int64)))
            told_probabilities = np.concatenate(
                (told_probabilities, np.empty(capacity - len(told_probabilities)))
            )
        for pair in range(len(known.tracks)):
            told[pairs, 0], told[pairs, 1] = c, labels[known.tracks[pair]]
            told[pairs, 2] = known.boxes[pair]
            told_probabilities[pairs] = known.probabilities[pair]
            pairs += 1
        if len(born) == 0:
            continue
        for k in range(len(born)):
            z = born[k]
            detection_probabilities[c, size + k] = rule.detection_probability
            sources[c, size + k], shares[c, size + k] = z, 1.0
            if born_existences[z] >= rule.least_told:
                told[pairs, 0], told[pairs, 1], told[pairs, 2] = c, next_label + k, z
                told_probabilities[pairs] = born_existences[z]
                pairs += 1
        existences = np.concatenate((existences, born_existences[born]))
        means = np.concatenate((means, found.newcomers.means[born]))
        covariances = np.concatenate((covariances, found.newcomers.covariances[born]))
        labels = np.concatenate((labels, next_label + np.arange(len(born))))
        next_label += len(born)
    everybody = len(existences)
    return StepResult(
        existences,
        means,
        covariances,
        labels,
        next_label,
        left,
        undetected_means,
        undetected_covariances,
        detection_probabilities[:, :everybody].copy(),
        hidden_by[:, :everybody].copy(),
        sources[:, :everybody].copy(),
        shares[:, :everybody].copy(),
        told[:pairs, 0].copy(),
        told[:pairs, 1].copy(),
        told[:pairs, 2].copy(),
        told_probabilities[:pairs].copy(),
        measured.values,
        measured.noises,
        unexplained,
    )


@kernel
def kept_tracks(
    existences: ndarray, means: ndarray, labels: ndarray, sources: ndarray, rule: KeepingRule
) -> ndarray:
    """Indices of the tracks that live on, the surest first.

    Left out are the faint, those who strayed, who are too many, and duplicates of others.

    Args:
        existences: (n,).
        means: (n, d), position first, world metres.
        labels: (n,).
        sources: (C, n), the box that each camera gave each, -1 for none.
        rule: Which of them.
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
