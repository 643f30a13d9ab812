"""Kernels over particles, compiled.

Every kernel must agree with a NumPy counterpart in the tests.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tracker.kernels.compilation import pixel_kernel


class FixedPoints(NamedTuple):
    """The ends of S climbs."""

    points: ndarray
    """(S, 4), centre x, centre y, half width, half height, pixels."""
    densities: ndarray
    """(S,), density at each end."""


class Modes(NamedTuple):
    """M modes of S fixed points."""

    owners: ndarray
    """(S,), index of the mode of each point, -1 for none."""
    leaders: ndarray
    """(M,), index of the densest point of each mode."""


@pixel_kernel
def epanechnikov_climb(
    boxes: ndarray,
    counts: ndarray,
    groups: ndarray,
    bandwidth: float,
    iterations: int,
    tolerance: float,
) -> FixedPoints:
    """Climb from every box to a fixed point of the mean shift with the Epanechnikov kernel.

    The density is Σ_i c_i max(0, 1 - r_i²), r_i the distance between the centres in units of
    bandwidth × half size of the current box. Its gradient points to the mean of the boxes
    with r_i < 1, which is where each step goes.

    Args:
        boxes: (S, 4), centre x, centre y, half width, half height.
        counts: (S,), number of particles at each box; boxes of 0 are ignored.
        groups: (S,), group of each box; boxes of other groups are ignored.
        bandwidth: Bandwidth, in half sizes.
        iterations: Largest number of steps.
        tolerance: Length of a step, in half sizes, below which the climb stops.
    """
    size = len(boxes)
    points = boxes.copy()
    densities = np.zeros(size)
    shifted = np.empty(4)
    for k in range(size):
        if not counts[k] > 0.0:
            continue
        for _ in range(iterations):
            scale_x = 1.0 / (bandwidth * points[k, 2])
            scale_y = 1.0 / (bandwidth * points[k, 3])
            shifted[:] = 0.0
            total, density = 0.0, 0.0
            for i in range(size):
                if groups[i] != groups[k] or not counts[i] > 0.0:
                    continue
                u = (boxes[i, 0] - points[k, 0]) * scale_x
                v = (boxes[i, 1] - points[k, 1]) * scale_y
                distance = u * u + v * v
                if distance >= 1.0:
                    continue
                total += counts[i]
                density += counts[i] * (1.0 - distance)
                for a in range(4):
                    shifted[a] += counts[i] * boxes[i, a]
            densities[k] = density
            if not total > 0.0:
                break  # the kernel has shrunk and contains no box: this is no mode
            for a in range(4):
                shifted[a] /= total
            u = (shifted[0] - points[k, 0]) / points[k, 2]
            v = (shifted[1] - points[k, 1]) / points[k, 3]
            points[k] = shifted
            if u * u + v * v < tolerance * tolerance:
                break
    return FixedPoints(points, densities)


@pixel_kernel
def join_modes(points: ndarray, counts: ndarray, order: ndarray, distance: float) -> Modes:
    """Assign fixed points that lie close to a denser one to its mode.

    Args:
        points: (S, 4), fixed points.
        counts: (S,), number of particles that climbed to each; points of 0 have no mode.
        order: (S,) indices, densest first.
        distance: Distance between the centres, in half sizes of the denser one.
    """
    size = len(points)
    owners = np.full(size, -1, dtype=np.int64)
    leaders = np.empty(size, dtype=np.int64)
    modes = 0
    for rank in range(size):
        i = order[rank]
        if not counts[i] > 0.0:
            continue
        for m in range(modes):
            leader = leaders[m]
            u = (points[i, 0] - points[leader, 0]) / points[leader, 2]
            v = (points[i, 1] - points[leader, 1]) / points[leader, 3]
            if u * u + v * v < distance * distance:
                owners[i] = m
                break
        if owners[i] < 0:
            owners[i] = modes
            leaders[modes] = i
            modes += 1
    return Modes(owners, leaders[:modes].copy())
