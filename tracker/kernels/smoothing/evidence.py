"""Information of one camera's boxes on paths, and their association with paths, compiled."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tracker.kernels.association import Convergence, belief_propagation
from tracker.kernels.boxes import Occlusion, hide, inside_probability
from tracker.kernels.compilation import kernel
from tracker.kernels.kalman import Expected, Measurements
from tracker.kernels.labelled import CameraRule
from tracker.kernels.linear_algebra import factorise, whiten
from tracker.kernels.measurement import ExpectedBoxes

_NO_SHARE = 1e-6
"""Probability below which a box has no effect on a path."""


class _Workspace(NamedTuple):
    """Working memory for one pair."""

    spread: ndarray
    """(m, m)."""
    lower: ndarray
    """(m, m)."""
    column: ndarray
    """(m,)."""
    whitened: ndarray
    """(m,), L⁻¹ column of the spread L Lᵀ."""


@kernel
def _workspace(size: int) -> _Workspace:
    """Allocate the working memory for measurements of a size."""
    return _Workspace(
        np.empty((size, size)), np.zeros((size, size)), np.empty(size), np.empty(size)
    )


@kernel
def _add_spread(jacobian: ndarray, covariance: ndarray, spread: ndarray) -> None:
    """Add H P Hᵀ of the position to ``spread``."""
    size = len(spread)
    for p in range(size):
        for b in range(3):
            half = 0.0
            for a in range(3):
                half += jacobian[p, a] * covariance[a, b]
            for q in range(size):
                spread[p, q] += half * jacobian[q, b]


@kernel
def _log_density(workspace: _Workspace) -> float:
    """log N(column; 0, spread); the whitened column is stored as well."""
    size = len(workspace.column)
    log_determinant = factorise(workspace.spread, workspace.lower)
    length = whiten(workspace.lower, workspace.column, workspace.whitened)
    return -0.5 * (size * math.log(2.0 * math.pi) + log_determinant + length)


class BoxInformation(NamedTuple):
    """The information of boxes on the positions of N rows: log L(p) = yᵀp − ½ pᵀ Y p + c."""

    matrices: ndarray
    """Y (N, 3, 3)."""
    vectors: ndarray
    """y (N, 3)."""
    constants: ndarray
    """c (N,)."""


class BoxLinks(NamedTuple):
    """L pairs of a row of a path and a box of one camera."""

    rows: ndarray
    """(L,), index of the row."""
    boxes: ndarray
    """(L,), index among the camera's boxes of all steps."""
    shares: ndarray
    """a (L,), association probability, 0 … 1."""


class Rows(NamedTuple):
    """N rows of paths, indexed by step."""

    states: ndarray
    """(N, d), states, position first, world metres."""
    covariances: ndarray
    """(N, d, d), covariances."""
    existences: ndarray
    """(N,), existence probabilities."""
    labels: ndarray
    """(N,), labels of their paths."""
    order: ndarray
    """(N,), the rows, step after step."""
    step_starts: ndarray
    """(T + 1,), index of each step's first row in ``order``, and N."""


class CameraSteps(NamedTuple):
    """The boxes of one camera at T steps."""

    starts: ndarray
    """(T + 1,), index of each step's first box, and B."""
    blind: ndarray
    """(T,), whether the camera had no frame."""
    measurements: Measurements
    clutter: ndarray
    """κ (B,) at each of its boxes, per unit of the measurement space."""


class SharedCamera(NamedTuple):
    """The association of one camera's boxes with N rows."""

    links: BoxLinks
    detection_probabilities: ndarray
    """(N,), p_D of each row."""
    missed: ndarray
    """(N,), probability of a miss."""
    hidden_by: ndarray
    """(N,), label of the occluder of each row, -1 for none."""


@kernel
def add_information(
    links: BoxLinks,
    states: ndarray,
    covariances: ndarray,
    expected: Expected,
    measurements: Measurements,
    information: BoxInformation,
) -> None:
    """Add the information of L boxes of a camera on the rows of paths, linearised at the states.

        Y += a Hᵀ R⁻¹ H,   y += a Hᵀ R⁻¹ (z − h(x) + H x),   c += a log N(z − h + H x; 0, R)

    with the association probability a of a box. Where a box may be of another posture, each posture
    counts with its probability at the states.

    Args:
        links: The L pairs of rows and boxes.
        states: (N, d) states.
        covariances: (N, d, d) covariances.
        expected: Predicted measurement of each of the L pairs.
        measurements: All boxes of the camera as measurements.
        information: The information that is added to.
    """
    rows, boxes, shares = links.rows, links.boxes, links.shares
    jacobians, spreads = expected.jacobians, expected.spreads
    other_expected, other_jacobians = expected.posture_values, expected.posture_jacobians
    other_drift, other_share = expected.posture_drift, expected.posture_share
    values, noises = measurements.values, measurements.noises
    size, workspace = values.shape[1], _workspace(values.shape[1])
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
            workspace.spread[:] = noise[0]
            _add_spread(jacobians[link], covariances[k], workspace.spread)
            for p in range(size):
                workspace.column[p] = values[z, p] - expected.values[link, p]
            upright = math.log(1.0 - other_share) + _log_density(workspace)
            low = -math.inf
            if other_expected[link, 0] < math.inf:
                workspace.spread[:] = noise[1]
                _add_spread(h, covariances[k], workspace.spread)
                for p in range(size):
                    workspace.column[p] = values[z, p] - other_expected[link, p]
                low = math.log(other_share) + _log_density(workspace)
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
                workspace.column[p] = values[z, p] - value[p]
                for a in range(3):
                    workspace.column[p] += h[p, a] * states[k, a]
            workspace.spread[:] = noise[kind]
            information.constants[k] += a_share * _log_density(workspace)
            for a in range(3):
                for p in range(size):
                    workspace.column[p] = h[p, a]
                whiten(workspace.lower, workspace.column, halves[a])
                total = 0.0
                for p in range(size):
                    total += halves[a, p] * workspace.whitened[p]
                information.vectors[k, a] += a_share * total
                for b in range(a + 1):
                    total = 0.0
                    for p in range(size):
                        total += halves[a, p] * halves[b, p]
                    information.matrices[k, a, b] += a_share * total
                    if b < a:
                        information.matrices[k, b, a] += a_share * total


@kernel
def share_camera(
    rows: Rows,
    camera: CameraSteps,
    seen: ExpectedBoxes,
    image_size: ndarray,
    rule: CameraRule,
) -> SharedCamera:
    """Associate a camera's boxes with paths at every step, given the states of all paths.

    Args:
        rows: The rows of the paths.
        camera: The boxes of the camera.
        seen: Predicted box of each row in the camera.
        image_size: (2,) width and height, pixels.
        rule: The update of the fusion; pairs from its ``reporting_threshold`` on are returned.
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
    base, workspace = np.empty((size, size)), _workspace(size)
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
            Occlusion(rule.near, rule.strength, rule.reporting_share),
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
                        workspace.column[p] = gap
                    if not within:
                        continue
                    for p in range(size):
                        for q in range(size):
                            workspace.spread[p, q] = base[p, q] + noises[z, p, q]
                    log_density = _log_density(workspace)
                    length = 0.0
                    for p in range(size):
                        length += workspace.whitened[p] * workspace.whitened[p]
                    if length > gate:
                        continue
                    detected[i, j] += weights[i] * chances_here[i] * share * math.exp(log_density)
        marginals = belief_propagation(
            1.0 - weights * chances_here,
            detected,
            camera.clutter[first : first + count],
            Convergence(rule.tolerance, rule.iterations),
        ).rows
        for i in range(len(own)):
            missed[own[i]] = marginals[i, 0]
            for j in range(count):
                if marginals[i, 1 + j] >= rule.reporting_threshold:
                    found_rows.append(own[i])
                    found_boxes.append(first + j)
                    found_shares.append(marginals[i, 1 + j])
    return SharedCamera(
        BoxLinks(
            np.array(found_rows, dtype=np.int64),  # in plain Python none at all would be floats
            np.array(found_boxes, dtype=np.int64),
            np.array(found_shares, dtype=np.float64),
        ),
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
    """Compute the log likelihood of the misses of one camera at some places.

        log(1 − p_D) where no box of the step overlaps the predicted one, else 0:
        an occluder would have a box there

    Args:
        expected: (N, 4) left, top, right, bottom, pixels.
        valid: (N,), whether the place is in front of the lens.
        chances: (N,) p_D, 0 outside the image.
        steps: (N,), step of each place.
        box_starts: (T + 1,), index of each step's first box, and B.
        boxes: (B, 4) centre and half sizes, pixels.

    Returns:
        (N,), log likelihoods, at most 0.
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
