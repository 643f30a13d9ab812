"""Estimation of people's displacement per step, from which the frame rate follows."""

from __future__ import annotations

from collections.abc import Sequence as Many

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from tracker.geometry.camera import Camera
from tracker.geometry.consistency.observed import Rays
from tracker.geometry.consistency.suggestion import consensus_of_cameras

WALKING = 1.2
"""Speed at which people walk indoors and among others, metres per second: a little below the
1.34 m/s of free walking (Weidmann, "Transporttechnik der Fussgänger", ETH Zürich, 1993, §3.1)."""

# The sensitivities below are of the rate that follows, in the random rooms of seeds 1500 … 1507 at
# 2, 6 and 25 steps/s, where it errs by 7 % (root mean square), and in four recordings, where people
# stand and the rate is up to 1.8 times too large.
SHARE = 0.8
"""Quantile of the displacements: most people in a room stand, talk or sit at any moment. With 0.6
the rate errs by 22 % in the rooms and by more in the recordings, too; with 0.9 by 12 % in the rooms
and by less in the recordings."""

CLEAR = 0.3
"""Displacement above which people have moved, and which measurement errors do not explain, metres.
Halved, the rate errs by 25 %; doubled by 21 %, and there is none for one recording."""

LAGS = (1, 2, 4, 8, 16, 32)
"""Numbers of steps over which displacements are measured. Up to 8 they do for 25 steps/s; at 120
there is no estimate in four of four random rooms without 32, and in one of four with it."""

_FARTHEST = 1.5
"""Largest displacement, metres; beyond it people would be confused. Halved or doubled it changes
the rate in rooms by 3 % at most, and halved by 17 % in one recording."""

_SAME = 0.4
"""Distance below which two triangulated places are of one person, metres. Halved, the rate errs by
9 % in the rooms; doubled by 6 %, and that of one recording is half as large."""

_LEAST_WAYS = 30
"""Least number of displacements for an estimate. In 72 beginnings of random rooms of 6, 12 and 30
steps the largest error is 36 % with 15, 30 and 60, which estimate 52, 33 and 20 of them, and a
factor of 2.8 with 1."""

_BLOCK = 2 * LAGS[-1]
"""Number of consecutive steps that are sampled together, so that half of them have a step
:data:`LAGS` later. Halved or doubled it changes the rate by 6 % at most, of one recording."""

_MOST_BOXES = 12_000
"""Largest number of boxes of all cameras that are used. Halved it changes the rate by 9 % at most,
doubled by 1 %; all 84,000 boxes of 20 people before five cameras take 1.3 s instead of 0.07."""


def pace(cameras: Many[Camera], rays: Many[Rays]) -> float | None:
    """Estimate the displacement of walking people per step, from triangulated boxes.

    Args:
        cameras: The calibrated cameras, in metres, z up.
        rays: Rays of each camera's boxes, in its own axes.

    Returns:
        Metres per step; None where no displacement exceeds the measurement errors.
    """
    within = [own.take(np.flatnonzero(np.isin(own.frames, _sampled_steps(rays)))) for own in rays]
    agreed = consensus_of_cameras(cameras, within, most_pairs=10**9)
    steps, places = _people(agreed.steps, agreed.feet[:, :2])
    for lag in LAGS:
        displacements = _displacements(steps, places, lag)
        if len(displacements) >= _LEAST_WAYS:
            displacement = float(np.quantile(displacements, SHARE))
            if displacement > CLEAR:
                return displacement / lag
    return None


def _sampled_steps(rays: Many[Rays]) -> Int[ndarray, " K"]:
    """The steps that are used: blocks spread over the recording, with a limited number of boxes."""
    frames = np.concatenate([np.zeros(0, dtype=np.int64), *(own.frames for own in rays)])
    if not len(frames):
        return frames
    blocks, counts = np.unique(frames // _BLOCK, return_counts=True)
    wanted = max(1, int(len(blocks) * min(1.0, _MOST_BOXES / counts.sum())))
    kept = blocks[np.unique(np.linspace(0, len(blocks) - 1, wanted).astype(int))]
    return np.asarray((kept[:, None] * _BLOCK + np.arange(_BLOCK)).ravel())


def _people(
    steps: Int[ndarray, " N"], places: Float[ndarray, "N 2"]
) -> tuple[Int[ndarray, " M"], Float[ndarray, "M 2"]]:
    """Average the triangulated places that lie together at one step."""
    near = KDTree(_in_one_tree(steps, places)).query_pairs(_SAME, output_type="ndarray")
    graph = coo_array((np.ones(len(near)), (near[:, 0], near[:, 1])), shape=(len(steps),) * 2)
    count, of = connected_components(graph, directed=False)
    size = np.bincount(of, minlength=count)
    means = [np.bincount(of, weights=axis, minlength=count) / size for axis in places.T]
    first = np.zeros(count, dtype=np.int64)
    first[of] = steps
    return first, np.stack(means, axis=1)


def _displacements(
    steps: Int[ndarray, " M"], places: Float[ndarray, "M 2"], lag: int
) -> Float[ndarray, " W"]:
    """Displacements over ``lag`` steps, metres, of people paired as mutual nearest neighbours."""
    if not len(steps):
        return np.zeros(0)
    now, later = _in_one_tree(steps, places), _in_one_tree(steps - lag, places)
    far, there = _nearest(later, now)
    _, back = _nearest(now, later)
    found = np.flatnonzero(np.isfinite(far))
    found = found[back[there[found]] == found]
    return np.asarray(far[found])


def _nearest(tree: Float[ndarray, "M 3"], points: Float[ndarray, "K 3"]) -> tuple[ndarray, ndarray]:
    """Distance of each point from the nearest point of a tree, infinite beyond 1.5 m, and the index
    of that point."""
    far, row = KDTree(tree).query(points, distance_upper_bound=_FARTHEST)
    return np.asarray(far), np.asarray(row)


def _in_one_tree(steps: Int[ndarray, " N"], places: Float[ndarray, "N 2"]) -> ndarray:
    """Points (N, 3) whose third coordinate separates different steps, for one search tree."""
    return np.column_stack([places, steps * 2.0 * _FARTHEST])
