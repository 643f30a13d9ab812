"""What the boxes of one camera say of paths, and which box belongs to which path: compiled."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tracker.kernels.association.belief_propagation import Settling, belief_propagation
from tracker.kernels.boxes import Occlusion, hide, inside_probability
from tracker.kernels.compilation import kernel
from tracker.kernels.gating import Measurements
from tracker.kernels.kalman import Expected
from tracker.kernels.labelled.camera_update import CameraRule
from tracker.kernels.linear_algebra import factorise
from tracker.kernels.measurement import ExpectedBoxes

_NO_SHARE = 1e-6
"""Probability below which a box tells nothing of a path."""


class _Room(NamedTuple):
    """To write in while one pair is worked out."""

    spread: ndarray
    """(m, m)."""
    lower: ndarray
    """(m, m)."""
    column: ndarray
    """(m,)."""
    whitened: ndarray
    """(m,), L⁻¹ column of the spread L Lᵀ."""


@kernel
def _room(size: int) -> _Room:
    return _Room(np.empty((size, size)), np.zeros((size, size)), np.empty(size), np.empty(size))


@kernel
def _add_spread(jacobian: ndarray, covariance: ndarray, spread: ndarray) -> None:
    """Add H P Hᵀ of the position."""
    size = len(spread)
    for p in range(size):
        for b in range(3):
            half = 0.0
            for a in range(3):
                half += jacobian[p, a] * covariance[a, b]
            for q in range(size):
                spread[p, q] += half * jacobian[q, b]


@kernel
def _whiten(lower: ndarray, right: ndarray, whitened: ndarray) -> float:
    """L⁻¹ b for a Cholesky factor L, and its squared length."""
    length = 0.0
    for p in range(len(right)):
        value = right[p]
        for r in range(p):
            value -= lower[p, r] * whitened[r]
        value /= lower[p, p]
        whitened[p] = value
        length += value * value
    return length


@kernel
def _log_density(room: _Room) -> float:
    """log N(column; 0, spread), and the whitened column."""
    size = len(room.column)
    log_determinant = factorise(room.spread, room.lower)
    length = _whiten(room.lower, room.column, room.whitened)
    return -0.5 * (size * math.log(2.0 * math.pi) + log_determinant + length)


class BoxInformation(NamedTuple):
    """What boxes say of the positions of N rows of paths: log L(p) = yᵀp − ½ pᵀ Y p + c."""

    matrices: ndarray
    """Y (N, 3, 3)."""
    vectors: ndarray
    """y (N, 3)."""
    constants: ndarray
    """c (N,)."""


class BoxLinks(NamedTuple):
    """L pairs of a row of a path and a box of a camera."""

    rows: ndarray
    """(L,)."""
    boxes: ndarray
    """(L,), index among the camera's boxes of all steps."""
    shares: ndarray
    """a (L,), association probability."""


class Rows(NamedTuple):
    """N rows of paths, and where each step's are."""

    states: ndarray
    """(N, d), position first."""
    covariances: ndarray
    """(N, d, d)."""
    existences: ndarray
    """(N,), that somebody is there."""
    labels: ndarray
    """(N,), of their paths."""
    order: ndarray
    """(N,), the rows, step after step."""
    step_starts: ndarray
    """(T + 1,), where each step's rows begin in ``order``, and the end."""


class CameraSteps(NamedTuple):
    """What one camera gave at T steps."""

    starts: ndarray
    """(T + 1,), where each step's boxes begin, and the end."""
    blind: ndarray
    """(T,), whether it had no frame."""
    measurements: Measurements
    clutter: ndarray
    """κ (B,) of each of its boxes."""


class SharedCamera(NamedTuple):
    """Who made which of a camera's boxes."""

    links: BoxLinks
    detection_probabilities: ndarray
    """(N,)."""
    missed: ndarray
    """(N,), probability of a miss."""
    hidden_by: ndarray
    """(N,), label of who hides each, -1 for nobody."""


@kernel
def add_information(
    links: BoxLinks,
    states: ndarray,
    covariances: ndarray,
    expected: Expected,
    measurements: Measurements,
    information: BoxInformation,
) -> None:
    """Add what L boxes of a camera say of the rows of paths, straightened at the states.

        Y += a Hᵀ R⁻¹ H,   y += a Hᵀ R⁻¹ (z − h(x) + H x),   c += a log N(z − h + H x; 0, R)

    with the share a of a box. Of a box that may show another posture, each counts with its
    probability at the states.

    Args:
        links: Whose box each is.
        states: (N, d).
        covariances: (N, d, d).
        expected: Of each of the L pairs.
        measurements: The camera's.
        information: Added to.
    """
    rows, boxes, shares = links.rows, links.boxes, links.shares
    jacobians, spreads = expected.jacobians, expected.spreads
    other_expected, other_jacobians = expected.posture_values, expected.posture_jacobians
    other_drift, other_share = expected.posture_drift, expected.posture_share
    values, noises = measurements.values, measurements.noises
    size, room = values.shape[1], _room(values.shape[1])
    kinds = 2 if len(other_expected) > 0 else 1
    noise, chances = np.empty((2, size, size)), np.ones(2)
    halves = np.empty((3, size))
    for link in range(len(rows)):
        k, z = rows[link], boxes[link]
        if shares[link] < _NO_SHARE:
            continue
        noise[0] = noises[z]
        if len(spreads):
            noise[0] += spreads[link]
        if kinds == 2:
            h = other_jacobians[link]
            noise[1] = noises[z]
            noise[1] += expected.posture_spreads[link]
            _add_spread(h, other_drift, noise[1])
            room.spread[:] = noise[0]
            _add_spread(jacobians[link], covariances[k], room.spread)
            for p in range(size):
                room.column[p] = values[z, p] - expected.values[link, p]
            upright = math.log(1.0 - other_share) + _log_density(room)
            low = -math.inf
            if other_expected[link, 0] < math.inf:
                room.spread[:] = noise[1]
                _add_spread(h, covariances[k], room.spread)
                for p in range(size):
                    room.column[p] = values[z, p] - other_expected[link, p]
                low = math.log(other_share) + _log_density(room)
            largest = max(upright, low)
            total = math.exp(upright - largest) + math.exp(low - largest)
            chances[0] = math.exp(upright - largest) / total
            chances[1] = math.exp(low - largest) / total
        for kind in range(kinds):
            a_share = shares[link] * chances[kind]
            if a_share < _NO_SHARE:
                continue
            h = jacobians[link] if kind == 0 else other_jacobians[link]
            value = expected.values[link] if kind == 0 else other_expected[link]
            for p in range(size):
                room.column[p] = values[z, p] - value[p]
                for a in range(3):
                    room.column[p] += h[p, a] * states[k, a]
            room.spread[:] = noise[kind]
            information.constants[k] += a_share * _log_density(room)
            for a in range(3):
                for p in range(size):
                    room.column[p] = h[p, a]
                _whiten(room.lower, room.column, halves[a])
                told = 0.0
                for p in range(size):
                    told += halves[a, p] * room.whitened[p]
                information.vectors[k, a] += a_share * told
                for b in range(a + 1):
                    told = 0.0
                    for p in range(size):
                        told += halves[a, p] * halves[b, p]
                    information.matrices[k, a, b] += a_share * told
                    if b < a:
                        information.matrices[k, b, a] += a_share * told


@kernel
def share_camera(
    rows: Rows,
    camera: CameraSteps,
    seen: ExpectedBoxes,
    image_size: ndarray,
    rule: CameraRule,
) -> SharedCamera:
    """Who made which of a camera's boxes, at every step, given where all paths lie.

    Args:
        rows: Of the paths.
        camera: Its boxes.
        seen: What it should give of each row.
        image_size: (2,) width and height, pixels.
        rule: Of the fusion; pairs from its ``least_told`` on are returned.
    """
    order, step_starts, existences = rows.order, rows.step_starts, rows.existences
    states, covariances, labels = rows.states, rows.covariances, rows.labels
    expected, boxes, depths, valid = seen.expected, seen.boxes, seen.depths, seen.valid
    jacobians, spreads = expected.jacobians, expected.spreads
    other_expected, other_jacobians = expected.posture_values, expected.posture_jacobians
    other_drift, other_share = expected.posture_drift, expected.posture_share
    values, noises = camera.measurements.values, camera.measurements.noises
    box_starts, gate = camera.starts, rule.gate
    rows_count, size = len(order), values.shape[1]
    chances, missed = np.zeros(rows_count), np.ones(rows_count)
    hidden = np.full(rows_count, -1, dtype=np.int64)
    found_rows, found_boxes, found_shares = [0], [0], [0.0]
    found_rows.pop(), found_boxes.pop(), found_shares.pop()
    kinds = 2 if len(other_expected) > 0 else 1
    base, room = np.empty((size, size)), _room(size)
    for step in range(len(step_starts) - 1):
        own = order[step_starts[step] : step_starts[step + 1]]
        if len(own) == 0 or camera.blind[step]:
            continue
        inside = rule.detection_probability * inside_probability(
            boxes[own], jacobians[own], covariances[own], valid[own], image_size, rule.soft
        )
        weights = existences[own]
        hiding = np.flatnonzero(weights > rule.confirmed) if rule.strength > 0.0 else np.arange(0)
        hidden_here = hide(
            inside,
            boxes[own],
            depths[own],
            states[own],
            labels[own],
            hiding,
            weights[hiding],
            Occlusion(rule.near, rule.strength, rule.worth_telling),
        )
        chances_here, hidden_by = hidden_here.detection_probabilities, hidden_here.hidden_by
        first, count = box_starts[step], box_starts[step + 1] - box_starts[step]
        detected = np.zeros((len(own), count))
        for i in range(len(own)):
            k = own[i]
            chances[k], hidden[k] = chances_here[i], hidden_by[i]
            if chances_here[i] <= 0.0:
                continue
            for kind in range(kinds):
                h = jacobians[k] if kind == 0 else other_jacobians[k]
                value = expected.values[k] if kind == 0 else other_expected[k]
                if not value[0] < math.inf:
                    continue
                base[:] = 0.0
                _add_spread(h, covariances[k], base)
                if kind == 0 and len(spreads):
                    base += spreads[k]
                if kind == 1:
                    _add_spread(h, other_drift, base)
                    base += expected.posture_spreads[k]
                share = 1.0
                if kinds == 2:
                    share = 1.0 - other_share if kind == 0 else other_share
                for j in range(count):
                    z = first + j
                    within = True
                    for p in range(size):
                        gap = values[z, p] - value[p]
                        within = within and gap * gap <= gate * (base[p, p] + noises[z, p, p])
                        room.column[p] = gap
                    if not within:
                        continue
                    for p in range(size):
                        for q in range(size):
                            room.spread[p, q] = base[p, q] + noises[z, p, q]
                    log_density = _log_density(room)
                    length = 0.0
                    for p in range(size):
                        length += room.whitened[p] * room.whitened[p]
                    if length > gate:
                        continue
                    detected[i, j] += weights[i] * chances_here[i] * share * math.exp(log_density)
        told = belief_propagation(
            1.0 - weights * chances_here,
            detected,
            camera.clutter[first : first + count],
            Settling(rule.tolerance, rule.iterations),
        ).rows
        for i in range(len(own)):
            missed[own[i]] = told[i, 0]
            for j in range(count):
                if told[i, 1 + j] >= rule.least_told:
                    found_rows.append(own[i])
                    found_boxes.append(first + j)
                    found_shares.append(told[i, 1 + j])
    return SharedCamera(
        BoxLinks(np.array(found_rows), np.array(found_boxes), np.array(found_shares)),
        chances,
        missed,
        hidden,
    )


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
