"""What the boxes of one camera say of paths, and which box belongs to which path: compiled."""

from __future__ import annotations

import math

import numpy as np
from numpy import ndarray

from tracker.kernels.boxes import hide, inside_probability
from tracker.kernels.compilation import kernel
from tracker.kernels.labelled.marginals import belief_propagation
from tracker.kernels.linear_algebra import factorise, solve


@kernel
def _posture(difference: ndarray, noise: ndarray, jacobian: ndarray, covariance: ndarray) -> float:
    """log N(z; h, R + H P Hᵀ)."""
    size = len(difference)
    s = noise.copy()
    for p in range(size):
        for q in range(size):
            for a in range(3):
                for b in range(3):
                    s[p, q] += jacobian[p, a] * covariance[a, b] * jacobian[q, b]
    lower, solved = np.zeros((size, size)), np.empty(size)
    log_determinant = factorise(s, lower)
    solve(lower, difference, solved)
    total = size * math.log(2.0 * math.pi) + log_determinant
    for p in range(size):
        total += difference[p] * solved[p]
    return -0.5 * total


@kernel
def add_information(
    rows: ndarray,
    boxes: ndarray,
    shares: ndarray,
    states: ndarray,
    covariances: ndarray,
    expected: ndarray,
    jacobians: ndarray,
    spreads: ndarray,
    measurements: ndarray,
    noises: ndarray,
    other_expected: ndarray,
    other_jacobians: ndarray,
    other_spreads: ndarray,
    other_drift: ndarray,
    other_share: float,
    information: ndarray,
    vectors: ndarray,
    constants: ndarray,
) -> None:
    """Add what L boxes of a camera say of the rows of paths, straightened at the states.

        Y += a Hᵀ R⁻¹ H,   y += a Hᵀ R⁻¹ (z − h(x) + H x),   c += a log N(z − h + H x; 0, R)

    with the share a of a box. Of a box that may show a person low, each posture counts with
    its probability at the states.

    Args:
        rows: (L,), to which row each box belongs.
        boxes: (L,), index into ``measurements``.
        shares: a (L,).
        states: (N, d), as ``covariances`` (N, d, d).
        expected: (L, m), as the next (L, m, d) and (L, m, m) or none.
        measurements: (B, m), as ``noises`` (B, m, m).
        other_expected: As the further ones, of :func:`tracker.kernels.kalman.all_pairs`.
        information: Y (N, 3, 3), added to, as ``vectors`` y (N, 3) and ``constants`` c (N,).
    """
    size = measurements.shape[1]
    kinds = 2 if len(other_expected) > 0 else 1
    lower, column, solved = np.zeros((size, size)), np.empty(size), np.empty(size)
    halves = np.empty((3, size))
    for link in range(len(rows)):
        k, z = rows[link], boxes[link]
        chances = np.ones(2)
        noise = np.empty((2, size, size))
        noise[0] = noises[z]
        if len(spreads):
            noise[0] += spreads[link]
        if kinds == 2:
            noise[1] = noises[z] + other_spreads[link]
            h = other_jacobians[link]
            for p in range(size):
                for q in range(size):
                    for a in range(3):
                        for b in range(3):
                            noise[1, p, q] += h[p, a] * other_drift[a, b] * h[q, b]
            upright = math.log(1.0 - other_share) + _posture(
                measurements[z] - expected[link], noise[0], jacobians[link], covariances[k]
            )
            low = -math.inf
            if other_expected[link, 0] < math.inf:
                low = math.log(other_share) + _posture(
                    measurements[z] - other_expected[link], noise[1], h, covariances[k]
                )
            largest = max(upright, low)
            total = math.exp(upright - largest) + math.exp(low - largest)
            chances[0] = math.exp(upright - largest) / total
            chances[1] = math.exp(low - largest) / total
        for kind in range(kinds):
            a_share = shares[link] * chances[kind]
            if a_share < 1e-6:
                continue
            h = jacobians[link] if kind == 0 else other_jacobians[link]
            value = expected[link] if kind == 0 else other_expected[link]
            for p in range(size):
                column[p] = measurements[z, p] - value[p]
                for a in range(3):
                    column[p] += h[p, a] * states[k, a]
            log_determinant = factorise(noise[kind], lower)
            solve(lower, column, solved)
            total = size * math.log(2.0 * math.pi) + log_determinant
            for p in range(size):
                total += column[p] * solved[p]
            constants[k] -= 0.5 * a_share * total
            for a in range(3):
                for p in range(size):
                    vectors[k, a] += a_share * h[p, a] * solved[p]
            for a in range(3):
                solve(lower, np.ascontiguousarray(h[:, a]), halves[a])
            for a in range(3):
                for b in range(3):
                    for p in range(size):
                        information[k, a, b] += a_share * h[p, a] * halves[b, p]


@kernel
def share_camera(
    order: ndarray,
    step_starts: ndarray,
    box_starts: ndarray,
    existences: ndarray,
    states: ndarray,
    covariances: ndarray,
    labels: ndarray,
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
    measurements: ndarray,
    noises: ndarray,
    clutter: float,
    gate: float,
    image_size: ndarray,
    soft: bool,
    detection_probability: float,
    confirmed: float,
    strength: float,
    near: float,
    least_covered: float,
    tolerance: float,
    iterations: int,
    least: float,
) -> tuple[ndarray, ndarray, ndarray, ndarray, ndarray, ndarray]:
    """Who made which of a camera's boxes, at every step, given where all paths lie.

    Args:
        order: (N,), the rows of paths, step after step.
        step_starts: (T + 1,), where each step's rows begin in ``order``.
        box_starts: (T + 1,), where each step's boxes begin.
        existences: (N,), that somebody is there.
        states: (N, d), as the next (N, d, d).
        labels: (N,), the path of each row.
        expected: (N, m), as the further ones of
            :func:`tracker.kernels.measurement.expected_measurements`.
        measurements: (B, m), as ``noises`` (B, m, m).
        clutter: κ.
        gate: As the further ones, of
            :func:`tracker.kernels.labelled.camera_update.update_by_camera`.
        least: Association probability from which a pair is returned.

    Returns:
        (L,) row, (L,) box and (L,) probability of each pair; (N,) p_D, (N,) probability of a
        miss, (N,) label of who hides each.
    """
    rows_count, size = len(order), measurements.shape[1]
    chances, missed = np.zeros(rows_count), np.ones(rows_count)
    hidden = np.full(rows_count, -1, dtype=np.int64)
    found_rows, found_boxes, found_shares = [0], [0], [0.0]
    found_rows.pop(), found_boxes.pop(), found_shares.pop()
    kinds = 2 if len(other_expected) > 0 else 1
    for step in range(len(step_starts) - 1):
        own = order[step_starts[step] : step_starts[step + 1]]
        if len(own) == 0:
            continue
        inside = detection_probability * inside_probability(
            boxes[own], jacobians[own], covariances[own], valid[own],
            (image_size[0], image_size[1]), soft,
        )  # fmt: skip
        weights = existences[own]
        hiding = np.flatnonzero(weights > confirmed) if strength > 0.0 else np.arange(0)
        seen, hidden_by = hide(
            inside, boxes[own], depths[own], states[own], labels[own], hiding, weights[hiding],
            near, strength, least_covered,
        )  # fmt: skip
        first, count = box_starts[step], box_starts[step + 1] - box_starts[step]
        detected = np.zeros((len(own), count))
        for i in range(len(own)):
            k = own[i]
            chances[k], hidden[k] = seen[i], hidden_by[i]
            if seen[i] <= 0.0:
                continue
            for kind in range(kinds):
                h = jacobians[k] if kind == 0 else other_jacobians[k]
                value = expected[k] if kind == 0 else other_expected[k]
                if not value[0] < math.inf:
                    continue
                base = np.zeros((size, size))
                for p in range(size):
                    for q in range(size):
                        for a in range(3):
                            for b in range(3):
                                spread = covariances[k, a, b]
                                if kind == 1:
                                    spread += other_drift[a, b]
                                base[p, q] += h[p, a] * spread * h[q, b]
                if kind == 0 and len(spreads):
                    base += spreads[k]
                if kind == 1:
                    base += other_spreads[k]
                share = 1.0
                if kinds == 2:
                    share = 1.0 - other_share if kind == 0 else other_share
                for j in range(count):
                    z = first + j
                    within = True
                    for p in range(size):
                        gap = measurements[z, p] - value[p]
                        within = within and gap * gap <= gate * (base[p, p] + noises[z, p, p])
                    if not within:
                        continue
                    s = base + noises[z]
                    lower, solved = np.zeros((size, size)), np.empty(size)
                    log_determinant = factorise(s, lower)
                    difference = measurements[z] - value
                    solve(lower, difference, solved)
                    length = 0.0
                    for p in range(size):
                        length += difference[p] * solved[p]
                    if length > gate:
                        continue
                    log_density = -0.5 * (length + log_determinant + size * math.log(2.0 * math.pi))
                    detected[i, j] += weights[i] * seen[i] * share * math.exp(log_density)
        told, _ = belief_propagation(
            1.0 - weights * seen, detected, np.full(count, clutter), tolerance, iterations
        )
        for i in range(len(own)):
            missed[own[i]] = told[i, 0]
            for j in range(count):
                if told[i, 1 + j] >= least:
                    found_rows.append(own[i])
                    found_boxes.append(first + j)
                    found_shares.append(told[i, 1 + j])
    return (
        np.array(found_rows), np.array(found_boxes), np.array(found_shares), chances, missed,
        hidden,
    )  # fmt: skip


@kernel
def seen_empty(
    expected: ndarray,
    valid: ndarray,
    chances: ndarray,
    steps: ndarray,
    box_starts: ndarray,
    boxes: ndarray,
) -> ndarray:
    """By how much a camera's look at some places speaks against anybody being there.

        log(1 − p_D) where no box of the step touches the one that he should give, else 0:
        whoever hides him has a box there

    Args:
        expected: (N, 4) left, top, right, bottom, pixels.
        valid: (N,), whether there is anything to see.
        chances: (N,) p_D, 0 outside the picture.
        steps: (N,).
        box_starts: (T + 1,), where each step's boxes begin.
        boxes: (B, 4) centre and half sizes, pixels.

    Returns:
        (N,), at most 0.
    """
    result = np.zeros(len(steps))
    for k in range(len(steps)):
        if not valid[k] or chances[k] <= 0.0:
            continue
        touched = False
        for z in range(box_starts[steps[k]], box_starts[steps[k] + 1]):
            across = min(expected[k, 2], boxes[z, 0] + boxes[z, 2]) - max(
                expected[k, 0], boxes[z, 0] - boxes[z, 2]
            )
            down = min(expected[k, 3], boxes[z, 1] + boxes[z, 3]) - max(
                expected[k, 1], boxes[z, 1] - boxes[z, 3]
            )
            touched = touched or (across > 0.0 and down > 0.0)
        if not touched:
            result[k] = math.log(max(1.0 - chances[k], 1e-6))
    return result
