"""Rays through the solids of a room."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tests.rooms.compiling import kernel

BOX, BALL, CYLINDER = 0, 1, 2
"""Kinds of solids: the cube, ball and upright cylinder of half size 1 in their own axes."""


class Hits(NamedTuple):
    """The first solid on each of N rays."""

    distances: ndarray
    """(N,), metres."""
    solids: ndarray
    """(N,), the index, -1 where there is none."""


@kernel
def cast(
    origins: ndarray,
    directions: ndarray,
    limits: ndarray,
    kinds: ndarray,
    inverses: ndarray,
    bounds: ndarray,
    any_hit: bool,
) -> Hits:
    """The first solid on each ray.

    Args:
        origins: (N, 3), metres.
        directions: (N, 3), unit vectors.
        limits: (N,), the length of each ray, metres.
        kinds: (P,), BOX, BALL or CYLINDER.
        inverses: (P, 3, 4), from the world to each solid's own axes.
        bounds: (P, 4), centre and radius of a ball around each solid.
        any_hit: Stop at any solid rather than the nearest, for shadows.
    """
    count = origins.shape[0]
    distances = np.empty(count, dtype=np.float32)
    solids = np.full(count, -1, dtype=np.int32)
    for n in range(count):
        ox, oy, oz = origins[n, 0], origins[n, 1], origins[n, 2]
        dx, dy, dz = directions[n, 0], directions[n, 1], directions[n, 2]
        best = limits[n]
        for p in range(kinds.shape[0]):
            cx, cy, cz = bounds[p, 0] - ox, bounds[p, 1] - oy, bounds[p, 2] - oz
            along = cx * dx + cy * dy + cz * dz
            radius2 = bounds[p, 3] * bounds[p, 3]
            squared = cx * cx + cy * cy + cz * cz
            if squared > radius2 and (along < 0.0 or squared - along * along > radius2):
                continue
            m = inverses[p]
            ax = m[0, 0] * ox + m[0, 1] * oy + m[0, 2] * oz + m[0, 3]
            ay = m[1, 0] * ox + m[1, 1] * oy + m[1, 2] * oz + m[1, 3]
            az = m[2, 0] * ox + m[2, 1] * oy + m[2, 2] * oz + m[2, 3]
            bx = m[0, 0] * dx + m[0, 1] * dy + m[0, 2] * dz
            by = m[1, 0] * dx + m[1, 1] * dy + m[1, 2] * dz
            bz = m[2, 0] * dx + m[2, 1] * dy + m[2, 2] * dz
            if kinds[p] == 0:
                near, far = -1e30, 1e30
                if abs(bx) > 1e-12:
                    s, e = (-1.0 - ax) / bx, (1.0 - ax) / bx
                    near, far = max(near, min(s, e)), min(far, max(s, e))
                elif abs(ax) > 1.0:
                    continue
                if abs(by) > 1e-12:
                    s, e = (-1.0 - ay) / by, (1.0 - ay) / by
                    near, far = max(near, min(s, e)), min(far, max(s, e))
                elif abs(ay) > 1.0:
                    continue
                if abs(bz) > 1e-12:
                    s, e = (-1.0 - az) / bz, (1.0 - az) / bz
                    near, far = max(near, min(s, e)), min(far, max(s, e))
                elif abs(az) > 1.0:
                    continue
                t = near
                if near > far or near < 1e-4:
                    continue
            else:
                a = bx * bx + by * by
                b = ax * bx + ay * by
                c = ax * ax + ay * ay - 1.0
                if kinds[p] == 1:
                    a += bz * bz
                    b += az * bz
                    c += az * az
                t = -1.0
                inner = b * b - a * c
                if inner > 0.0 and a > 1e-14:
                    t = (-b - math.sqrt(inner)) / a
                if kinds[p] == 2:
                    if t > 0.0 and abs(az + t * bz) > 1.0:
                        t = -1.0
                    if t <= 0.0 and abs(bz) > 1e-12:
                        s = ((1.0 if bz < 0.0 else -1.0) - az) / bz
                        hx, hy = ax + s * bx, ay + s * by
                        if s > 0.0 and hx * hx + hy * hy < 1.0:
                            t = s
                if t < 1e-4:
                    continue
            if t < best:
                best = t
                solids[n] = p
                if any_hit:
                    break
        distances[n] = best
    return Hits(distances, solids)
