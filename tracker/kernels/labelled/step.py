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
from tracker.kernels.labelled.camera_update import (
    CameraModel,
    CameraRecord,
    Tracks,
    update_by_camera,
)
from tracker.kernels.lens import Calibrations, one_camera
from tracker.kernels.linear_algebra import Gaussians, ToldPairs, duplicates, inside_bounds
from tracker.kernels.measurement import Target, Transform, expected_measurements, measured_boxes


class CameraBoxes(NamedTuple):
    """B boxes of C cameras, one camera after another."""

    boxes: ndarray
    """(B, 4) centre and half sizes, pixels."""
    sigmas: ndarray
    """(B, 4), standard deviations of the same, pixels."""
    starts: ndarray
    """(C + 1,), where each camera's boxes begin, and the end."""


class Motion(NamedTuple):
    """How people move in one step, and whether they stay."""

    transition: ndarray
    """F (d, d)."""
    noise: ndarray
    """Q (1, d, d)."""
    survival_probability: float


class StepModel(NamedTuple):
    """What stays from step to step: motion, births, cameras and how their boxes are taken."""

    motion: Motion
    births: Gaussians
    """They join the undetected."""
    transform: Transform
    sigma_factor: float
    """On the boxes' standard deviations."""
    target: Target
    cameras: Calibrations
    clutter: ndarray
    """κ (C,)."""
    update: CameraModel
    least_existence: float
    """Of a track that begins."""


class StepResult(NamedTuple):
    """Everybody in a room after one step, and why."""

    tracks: Tracks
    next_label: int
    """The first that is free."""
    undetected: Gaussians
    record: CameraRecord
    """Of each camera and track: (C, n) each."""
    pairs: ToldPairs
    measurements: Measurements
    """The boxes as such."""
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
    """As ``confirmed``, of :func:`tracker.kernels.linear_algebra.duplicates`."""
    confirmed: float


@kernel
def predict_and_update(
    tracks: Tracks,
    next_label: int,
    undetected: Gaussians,
    seen: CameraBoxes,
    model: StepModel,
) -> StepResult:
    """Predict n tracks and the U people never yet detected, update them by C cameras' boxes.

    Camera after camera, in their order, each with :func:`update_by_camera`; what a box makes of
    the undetected begins a track, which the cameras after it update.

    Args:
        tracks: Of the step before.
        next_label: The first that is free.
        undetected: Of the step before.
        seen: What the cameras show.
        model: Of the room, its cameras and its people.
    """
    starts, clutter, update = seen.starts, model.clutter, model.update
    survival_probability, labels = model.motion.survival_probability, tracks.labels
    count = len(seen.boxes)
    cameras = len(starts) - 1
    moved = predict(tracks.means, tracks.covariances, model.motion.transition, model.motion.noise)
    means, covariances = moved.means, moved.covariances
    existences = tracks.existences * survival_probability
    waiting = predict(
        undetected.means, undetected.covariances, model.motion.transition, model.motion.noise
    )
    left = np.concatenate((undetected.weights * survival_probability, model.births.weights))
    undetected_means = np.concatenate((waiting.means, model.births.means))
    undetected_covariances = np.concatenate((waiting.covariances, model.births.covariances))
    measured = measured_boxes(seen.boxes, (model.sigma_factor * seen.sigmas) ** 2, model.transform)

    most = len(existences) + count
    occluding = np.zeros(most)
    for i in range(len(existences)):
        if existences[i] > update.confirmed:
            occluding[i] = existences[i]
    detection_probabilities = np.zeros((cameras, most))
    shares = np.zeros((cameras, most))
    hidden_by = np.full((cameras, most), -1, dtype=np.int64)
    sources = np.full((cameras, most), -1, dtype=np.int64)
    unexplained = np.empty(count)
    capacity = 4 * most
    told = np.empty((capacity, 3), dtype=np.int64)
    told_probabilities = np.empty(capacity)
    pairs = 0
    for c in range(cameras):
        own = slice(starts[c], starts[c + 1])
        size = len(existences)
        camera = one_camera(model.cameras, c)
        found = update_by_camera(
            Gaussians(left, undetected_means, undetected_covariances),
            Tracks(existences, means, covariances, labels),
            occluding[:size],
            Measurements(measured.values[own], measured.noises[own]),
            expected_measurements(
                np.concatenate((undetected_means, means)),
                np.concatenate((undetected_covariances, covariances)),
                model.target,
                camera,
            ),
            camera.image_size,
            clutter[c],
            update,
        )
        existences, means = found.tracks.weights, found.tracks.means
        covariances = found.tracks.covariances
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
            detection_probabilities[c, size + k] = update.detection_probability
            sources[c, size + k], shares[c, size + k] = z, 1.0
            if born_existences[z] >= update.least_told:
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
        Tracks(existences, means, covariances, labels),
        next_label,
        Gaussians(left, undetected_means, undetected_covariances),
        CameraRecord(
            detection_probabilities[:, :everybody].copy(),
            hidden_by[:, :everybody].copy(),
            sources[:, :everybody].copy(),
            shares[:, :everybody].copy(),
        ),
        ToldPairs(
            told[:pairs, 0].copy(),
            told[:pairs, 1].copy(),
            told[:pairs, 2].copy(),
            told_probabilities[:pairs].copy(),
        ),
        measured,
        unexplained,
    )


@kernel
def kept_tracks(tracks: Tracks, sources: ndarray, rule: KeepingRule) -> ndarray:
    """Indices of the tracks that live on, the surest first.

    Left out are the faint, those who strayed, who are too many, and duplicates of others.

    Args:
        tracks: n of them.
        sources: (C, n), the box that each camera gave each, -1 for none.
        rule: Which of them.
    """
    existences, means, labels = tracks.existences, tracks.means, tracks.labels
    alive = inside_bounds(means, rule.low, rule.high)
    alive = alive[existences[alive] >= rule.least_existence]
    order = alive[heaviest_first(existences[alive])][: rule.most]
    duplicate = duplicates(
        means[order],
        existences[order],
        labels[order],
        sources[:, order],
        rule.near,
        rule.confirmed,
    )
    return np.asarray(order[~duplicate])
