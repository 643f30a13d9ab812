"""Births from the boxes of several cameras, compiled: meeting points of rays, and their fit."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tracker.kernels.boxes import expected_boxes
from tracker.kernels.compilation import kernel
from tracker.kernels.kalman import Measurements
from tracker.kernels.lens import Calibrations, one_camera
from tracker.kernels.linear_algebra import factorise, solve, squared_length
from tracker.kernels.measurement import Target

STEEPEST = 1e8
"""Ratio of a place's projected variance to a box's variance above which the box is not used. The
place is then far outside the image, where the polynomial of the lens maps a millimetre to many
image widths, and adding the two would lose the smaller one to rounding."""


class FreeBoxes(NamedTuple):
    """F boxes that no track explains."""

    indices: ndarray
    """(F,), indices among all boxes."""
    starts: ndarray
    """(C + 1,), index of each camera's first box among them, and F."""
    cameras: int
    """Number of cameras that have such a box."""


class MeetingPoints(NamedTuple):
    """N points where rays of two cameras pass close by each other."""

    points: ndarray
    """(N, 3), world metres."""
    gaps: ndarray
    """(N,), distances between the rays, metres."""
    pairs: ndarray
    """(N, 2), indices of the two rays."""


class FittedPlaces(NamedTuple):
    """N places that explain boxes of several cameras."""

    positions: ndarray
    """(N, 3), world metres."""
    covariances: ndarray
    """(N, 3, 3), squared metres."""
    sources: ndarray
    """(C, N) index of the box in each camera, -1 for none."""
    fits: ndarray
    """(C, N) log N(z; h(x), R) of that box."""


class Refinement(NamedTuple):
    """Parameters of the fit of places."""

    start_sigma: float
    """Prior standard deviation around the seed, metres."""
    passes: int
    """Number of Gauss-Newton steps after that by the two boxes of a seed."""
    gate: float
    """Squared Mahalanobis distance within which a box belongs to the place."""


@kernel
def free_boxes(unexplained: ndarray, starts: ndarray, least: float) -> FreeBoxes:
    """Select the boxes that no track explains.

    Args:
        unexplained: (B,), probability that no track made each box.
        starts: (C + 1,), index of each camera's first box, and B.
        least: Probability above which a box is free.
    """
    free = np.flatnonzero(unexplained > least)
    begins = np.searchsorted(free, starts)
    cameras = 0
    for c in range(len(starts) - 1):
        cameras += begins[c + 1] > begins[c]
    return FreeBoxes(free, begins, cameras)


@kernel
def meeting_points(
    rays: ndarray, starts: ndarray, centres: ndarray, largest_gap: float
) -> MeetingPoints:
    """Compute the midpoints between rays of two cameras that pass close by each other.

    Two rays o_a + s u and o_b + t v are nearest to each other where (o_a + s u − o_b − t v) is
    perpendicular to both: the midpoint method (Hartley, Sturm, "Triangulation", Computer Vision and
    Image Understanding 68(2), 1997, §5.3). Points less than 0.1 m ahead of a lens are left out.

    Args:
        rays: (B, 3) unit directions, camera after camera, world axes.
        starts: (C + 1,), index of each camera's first ray, and B.
        centres: (C, 3), positions of the cameras' lenses, world metres.
        largest_gap: Largest distance between two rays that meet, metres.
    """
    cameras = len(centres)
    room = 0
    for a in range(cameras):
        room += (starts[a + 1] - starts[a]) * (starts[cameras] - starts[a + 1])
    points, gaps, pairs = np.empty((room, 3)), np.empty(room), np.empty((room, 2), np.int64)
    count = 0
    for a in range(cameras):
        for b in range(a + 1, cameras):
            base = centres[b] - centres[a]
            for i in range(starts[a], starts[a + 1]):
                u_base = base[0] * rays[i, 0] + base[1] * rays[i, 1] + base[2] * rays[i, 2]
                for j in range(starts[b], starts[b + 1]):
                    uv, v_base = 0.0, 0.0
                    for axis in range(3):
                        uv += rays[i, axis] * rays[j, axis]
                        v_base += base[axis] * rays[j, axis]
                    denominator = max(1.0 - uv * uv, 1e-6)
                    along_a = (u_base - uv * v_base) / denominator
                    along_b = (uv * u_base - v_base) / denominator
                    if along_a <= 0.1 or along_b <= 0.1:
                        continue
                    gap = 0.0
                    for axis in range(3):
                        on_a = centres[a, axis] + along_a * rays[i, axis]
                        on_b = centres[b, axis] + along_b * rays[j, axis]
                        points[count, axis] = (on_a + on_b) / 2.0
                        gap += (on_a - on_b) ** 2
                    gap = math.sqrt(gap)
                    if gap < largest_gap:
                        gaps[count] = gap
                        pairs[count, 0], pairs[count, 1] = i, j
                        count += 1
    return MeetingPoints(points[:count].copy(), gaps[:count].copy(), pairs[:count].copy())


@kernel
def fit_places(
    seeds: ndarray,
    pairs: ndarray,
    measurements: Measurements,
    free: ndarray,
    starts: ndarray,
    target: Target,
    cameras: Calibrations,
    refinement: Refinement,
) -> FittedPlaces:
    """Move each seed to the place that explains the nearest free box of every camera best.

    Gauss-Newton steps minimise the boxes' residuals, with a weak prior at the seed. The first is
    by the two boxes of the seed alone, whose place is then accurate enough that in a crowd no box
    of somebody else is the nearest; each later step chooses the nearest box of every camera anew.
    Boxes of a camera are not used for a place that is far outside its image (:data:`STEEPEST`).

    Args:
        seeds: (N, 3), world metres.
        pairs: (N, 2), indices among all boxes of the two whose rays meet at each seed, -1 for
            none.
        measurements: The B boxes as measurements, camera after camera, each with its noise.
        free: (B,), whether no track explains each box, so that it may be of a new target.
        starts: (C + 1,), index of each camera's first box, and B.
        target: The model of an upright target.
        cameras: The C cameras.
        refinement: Parameters of the fit.
    """
    values, noises = measurements.values, measurements.noises
    start_sigma, gate = refinement.start_sigma, refinement.gate
    count, size, views = len(seeds), values.shape[1], len(cameras.rotations)
    positions = seeds.copy()
    covariances = np.zeros((count, 3, 3))
    for n in range(count):
        for axis in range(3):
            covariances[n, axis, axis] = start_sigma**2
    information, pull = np.empty((count, 3, 3)), np.empty((count, 3))
    sources = np.full((views, count), -1, dtype=np.int64)
    lower, spread, own = np.zeros((size, size)), np.empty((size, size)), np.empty((size, size))
    residual, solved = np.empty(size), np.empty(size)
    lower3, unit, column = np.zeros((3, 3)), np.zeros(3), np.empty(3)
    for turn in range(refinement.passes + 1):
        for n in range(count):
            for a in range(3):
                for b in range(3):
                    information[n, a, b] = 1.0 / start_sigma**2 if a == b else 0.0
                pull[n, a] = seeds[n, a] / start_sigma**2
        for c in range(views):
            if starts[c] == starts[c + 1]:
                continue
            seen = expected_boxes(
                positions, target.half_height, target.half_width, size, one_camera(cameras, c)
            )
            expected, slopes, valid = seen.values, seen.jacobians, seen.valid
            for n in range(count):
                sources[c, n] = -1
                if not valid[n]:
                    continue
                for p in range(size):
                    for q in range(size):
                        total = 0.0
                        for a in range(3):
                            for b in range(3):
                                total += slopes[n, p, a] * covariances[n, a, b] * slopes[n, q, b]
                        own[p, q] = total
                least = gate
                for box in range(starts[c], starts[c + 1]):
                    near = free[box]
                    if turn == 0:
                        near = box == pairs[n, 0] or box == pairs[n, 1]
                    if not near:
                        continue
                    for p in range(size):
                        residual[p] = values[box, p] - expected[n, p]
                        for q in range(size):
                            spread[p, q] = noises[box, p, q] + own[p, q]
                        # no component of a box alone may be beyond the gate
                        near = near and residual[p] ** 2 <= gate * spread[p, p]
                        near = near and own[p, p] <= STEEPEST * noises[box, p, p]
                    if not near:
                        continue
                    factorise(spread, lower)
                    distance = squared_length(residual, lower)
                    if distance < least or (distance == least and sources[c, n] < 0):
                        least = distance
                        sources[c, n] = box - starts[c]
                if sources[c, n] < 0:
                    continue
                box = starts[c] + sources[c, n]
                factorise(noises[box], lower)
                for p in range(size):
                    residual[p] = values[box, p] - expected[n, p]
                    for a in range(3):
                        residual[p] += slopes[n, p, a] * positions[n, a]
                solve(lower, residual, solved)
                for a in range(3):
                    for p in range(size):
                        pull[n, a] += slopes[n, p, a] * solved[p]
                for b in range(3):
                    for p in range(size):
                        residual[p] = slopes[n, p, b]
                    solve(lower, residual, solved)
                    for a in range(3):
                        for p in range(size):
                            information[n, a, b] += slopes[n, p, a] * solved[p]
        for n in range(count):
            factorise(information[n], lower3)
            solve(lower3, pull[n], positions[n])
            for a in range(3):
                unit[:] = 0.0
                unit[a] = 1.0
                solve(lower3, unit, column)
                for b in range(3):
                    covariances[n, b, a] = column[b]
    fits = np.zeros((views, count))
    for c in range(views):
        if starts[c] == starts[c + 1]:
            continue
        expected = expected_boxes(
            positions, target.half_height, target.half_width, size, one_camera(cameras, c)
        ).values
        for n in range(count):
            if sources[c, n] < 0:
                continue
            box = starts[c] + sources[c, n]
            log_determinant = factorise(noises[box], lower)
            for p in range(size):
                residual[p] = values[box, p] - expected[n, p]
            fits[c, n] = -0.5 * (
                squared_length(residual, lower) + log_determinant + size * math.log(2.0 * math.pi)
            )
    return FittedPlaces(positions, covariances, sources, fits)
