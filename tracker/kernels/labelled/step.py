"""One step of the labelled filter over all cameras, compiled.

One call a step: the calls between its parts would take longer than the parts.
"""

from __future__ import annotations

import numpy as np
from numpy import ndarray

from tracker.kernels.compilation import kernel
from tracker.kernels.intensity.mixture import heaviest_first, predict
from tracker.kernels.labelled.camera_update import update_by_camera
from tracker.kernels.linear_algebra import doubles, inside_bounds
from tracker.kernels.measurement import expected_measurements, measured_boxes


@kernel
def predict_and_update(
    existences: ndarray,
    means: ndarray,
    covariances: ndarray,
    labels: ndarray,
    next_label: int,
    undetected_weights: ndarray,
    undetected_means: ndarray,
    undetected_covariances: ndarray,
    boxes: ndarray,
    sigmas: ndarray,
    starts: ndarray,
    transition: ndarray,
    motion_noise: ndarray,
    survival_probability: float,
    birth_weights: ndarray,
    birth_means: ndarray,
    birth_covariances: ndarray,
    sigma_factor: float,
    transform: ndarray,
    products: ndarray,
    unscented: bool,
    half_height: float,
    half_width: float,
    low_half_height: float,
    low_half_width: float,
    low_noise: ndarray,
    size: int,
    low_drift: ndarray,
    low_share: float,
    image_sizes: ndarray,
    rotations: ndarray,
    translations: ndarray,
    intrinsics: ndarray,
    distortions: ndarray,
    nearest_depth: float,
    largest_radii: ndarray,
    clutter: ndarray,
    gate: float,
    soft: bool,
    detection_probability: float,
    confirmed: float,
    strength: float,
    near: float,
    least_covered: float,
    tolerance: float,
    iterations: int,
    least_told: float,
    least_existence: float,
) -> tuple[
    ndarray, ndarray, ndarray, ndarray, int, ndarray, ndarray, ndarray,
    ndarray, ndarray, ndarray, ndarray, ndarray, ndarray, ndarray, ndarray,
    ndarray, ndarray, ndarray,
]:  # fmt: skip
    """Predict n tracks and the U people never yet detected, update them by C cameras' boxes.

    Camera after camera, in their order, each with :func:`update_by_camera`; what a box makes of
    the undetected begins a track, which the cameras after it update.

    Args:
        existences: (n,), as the next two (n, d) and (n, d, d), and (n,) labels.
        next_label: The first that is free.
        undetected_weights: (U,), as the next two (U, d) and (U, d, d).
        boxes: (B, 4) of all cameras, one after another, and (B, 4) standard deviations, pixels.
        starts: (C + 1,), where each camera's boxes begin, and the end.
        transition: F (d, d), and Q (1, d, d).
        birth_weights: (G,), as the next two (G, d) and (G, d, d); they join the undetected.
        sigma_factor: On the standard deviations.
        transform: As ``products``, of :func:`tracker.kernels.measurement.measured_boxes`.
        unscented: As the further ones up to ``size``, of
            :func:`tracker.kernels.measurement.expected_measurements`.
        low_drift: (d, d), as ``low_share``, of :func:`tracker.kernels.kalman.all_pairs`.
        image_sizes: (C, 2), as the further ones, of a camera each.
        clutter: κ (C,).
        gate: As the further ones up to ``least_told``, of :func:`update_by_camera`.
        least_existence: Of a track that begins.

    Returns:
        Of the n' tracks: existences, means, covariances and labels; the first free label. Of
        the undetected: weights, means, covariances. Of each camera and track (C, n'): p_D, the
        label of who hides it or -1, the box that is most likely its own or -1, and that
        probability. Of the A pairs worth telling: camera, label, box and probability. Of the
        boxes: (B, m) measurements, (B, m, m) noises, and (B,) the probability that no track
        made each.
    """
    count = len(boxes)
    cameras = len(starts) - 1
    means, covariances = predict(means, covariances, transition, motion_noise)
    existences = existences * survival_probability
    unseen_means, unseen_covariances = predict(
        undetected_means, undetected_covariances, transition, motion_noise
    )
    left = np.concatenate((undetected_weights * survival_probability, birth_weights))
    unseen_means = np.concatenate((unseen_means, birth_means))
    unseen_covariances = np.concatenate((unseen_covariances, birth_covariances))
    values, noises = measured_boxes(boxes, (sigma_factor * sigmas) ** 2, transform, products)

    most = len(existences) + count
    occluding = np.zeros(most)
    for i in range(len(existences)):
        if existences[i] > confirmed:
            occluding[i] = existences[i]
    chances = np.zeros((cameras, most))
    shares = np.zeros((cameras, most))
    hidden_by = np.full((cameras, most), -1, dtype=np.int64)
    sources = np.full((cameras, most), -1, dtype=np.int64)
    unexplained = np.empty(count)
    capacity = 4 * most
    told = np.empty((capacity, 3), dtype=np.int64)
    told_chances = np.empty(capacity)
    pairs = 0
    for c in range(cameras):
        own = slice(starts[c], starts[c + 1])
        tracks = len(existences)
        (
            expected, jacobians, spreads, drawn, depths, valid,
            low_expected, low_jacobians, low_spreads,
        ) = expected_measurements(
            np.concatenate((unseen_means, means)),
            np.concatenate((unseen_covariances, covariances)),
            unscented, half_height, half_width, low_half_height, low_half_width, low_noise, size,
            (image_sizes[c, 0], image_sizes[c, 1]), rotations[c], translations[c], intrinsics[c],
            distortions[c], nearest_depth, largest_radii[c],
        )  # fmt: skip
        (
            existences, means, covariances, p_d, occluders, best, best_shares,
            left, newcomer, born_means, born_covariances, unexplained[own],
            who, what, chance,
        ) = update_by_camera(
            left, unseen_means, unseen_covariances,
            existences, means, covariances, labels, occluding[:tracks],
            values[own], noises[own], clutter[c], gate,
            expected, jacobians, spreads, drawn, depths, valid,
            low_expected, low_jacobians, low_spreads, low_drift, low_share,
            (image_sizes[c, 0], image_sizes[c, 1]), soft, detection_probability, confirmed,
            strength, near, least_covered, tolerance, iterations, least_told,
        )  # fmt: skip
        chances[c, :tracks], hidden_by[c, :tracks] = p_d, occluders
        sources[c, :tracks], shares[c, :tracks] = best, best_shares
        born_existences = unexplained[own] * newcomer
        born = np.flatnonzero(born_existences > least_existence)
        needed = pairs + len(who) + len(born)
        if needed > capacity:
            capacity = 2 * needed
            told = np.concatenate((told, np.empty((capacity - len(told), 3), dtype=np.int64)))
            told_chances = np.concatenate((told_chances, np.empty(capacity - len(told_chances))))
        for pair in range(len(who)):
            told[pairs, 0], told[pairs, 1], told[pairs, 2] = c, labels[who[pair]], what[pair]
            told_chances[pairs] = chance[pair]
            pairs += 1
        if len(born) == 0:
            continue
        for k in range(len(born)):
            z = born[k]
            chances[c, tracks + k] = detection_probability
            sources[c, tracks + k], shares[c, tracks + k] = z, 1.0
            if born_existences[z] >= least_told:
                told[pairs, 0], told[pairs, 1], told[pairs, 2] = c, next_label + k, z
                told_chances[pairs] = born_existences[z]
                pairs += 1
        existences = np.concatenate((existences, born_existences[born]))
        means = np.concatenate((means, born_means[born]))
        covariances = np.concatenate((covariances, born_covariances[born]))
        labels = np.concatenate((labels, next_label + np.arange(len(born))))
        next_label += len(born)
    found = len(existences)
    return (
        existences, means, covariances, labels, next_label, left, unseen_means, unseen_covariances,
        chances[:, :found].copy(), hidden_by[:, :found].copy(), sources[:, :found].copy(),
        shares[:, :found].copy(), told[:pairs, 0].copy(), told[:pairs, 1].copy(),
        told[:pairs, 2].copy(), told_chances[:pairs].copy(), values, noises, unexplained,
    )  # fmt: skip


@kernel
def kept_tracks(
    existences: ndarray,
    means: ndarray,
    labels: ndarray,
    sources: ndarray,
    least_existence: float,
    low: ndarray,
    high: ndarray,
    most: int,
    near: float,
    confirmed: float,
) -> ndarray:
    """Indices of the tracks that live on, the surest first: not faint, strayed, too many, doubles.

    Args:
        existences: (n,).
        means: (n, d), position first, world metres.
        labels: As ``sources``, of :func:`tracker.kernels.linear_algebra.doubles`, and ``near``
            and ``confirmed``.
        least_existence: Who has less is dropped.
        low: (3,), as ``high``, the corners that a track stays between.
        most: No more than this are kept.
    """
    alive = inside_bounds(means, low, high)
    alive = alive[existences[alive] >= least_existence]
    order = alive[heaviest_first(existences[alive])][:most]
    double = doubles(
        means[order], existences[order], labels[order], sources[:, order], near, confirmed
    )
    return np.asarray(order[~double])
