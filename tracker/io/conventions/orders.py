"""Whose calibration is whose where nothing meets as it is given: all assignments, pair by pair.

For boxes of camera a with calibration k and boxes of camera b with calibration l, people along an
axis of the world triangulate to heights; W(a, k, b, l; h) is how many boxes of a have a partner of
about the height h. The assignment o that maximises Σ W(a, o(a), b, o(b); h) over all h and axes is
a quadratic assignment problem, which few cameras allow to solve by trying every permutation.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence as Many

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.geometry.consistency.consensus import LARGEST_GAP, SPREAD
from tracker.geometry.consistency.likelihood import Moments, at_moments
from tracker.geometry.consistency.observed import in_world, rays_of
from tracker.io.conventions.judge import Judge, Seen
from tracker.io.conventions.reading import Reading, boxes_by, pose
from tracker.kernels import consistency as kernels

MOST_CAMERAS = 8
"""Number of cameras above which permutations are too many."""

# The sensitivities below are of calibrations in any order in 44 random rooms of seeds 1500 … 1563
# with five to seven cameras, some of people who sit, of detectors that miss a third, or of 6 steps:
# all are assigned rightly.
_HEIGHTS = np.arange(np.log(0.01), np.log(2.0), 0.2)
"""Logarithm of the heights of people that are told apart, in the rig's size. Steps of 0.1 and 0.4,
and heights between 0.05 and 1 alone, assign all as well."""

_MOST_PAIRS = 1500
"""Largest number of pairs of boxes of two cameras. Halved and doubled it assigns all as well;
without it eight cameras before 15 people take 2.8 s instead of 1.2."""


def likely_orders(
    judge: Judge,
    seen: Many[Seen | None],
    moments: Int[ndarray, " M"],
    reading: Reading,
    axes: Many[int] = (0, 1, 2),
) -> list[tuple[float, tuple[int, ...]]]:
    """Find the assignments of calibrations to cameras with which most boxes meet.

    Args:
        judge: Of the calibrations.
        seen: Boxes of each camera.
        moments: Steps that are looked at.
        reading: How calibrations and boxes are meant.
        axes: Of the world, along which people may stand.

    Returns:
        Score and assignment of the best one along each axis, the best first: the calibration of
        each camera.
    """
    count = len(judge.cameras)
    cameras = list(itertools.combinations(range(count), 2))
    orders = np.array(list(itertools.permutations(range(count))))
    found: dict[tuple[int, ...], float] = {}
    for axis in np.eye(3)[list(axes)]:
        pairs = _by_height(judge, seen, moments, reading, axis)
        pairs = pairs[..., :-1] + pairs[..., 1:]
        height = int(np.argmax(sum(pairs[a, :, b].max(axis=(0, 1)) for a, b in cameras)))
        scores = np.zeros(len(orders))
        for a, b in cameras:
            scores += pairs[a, orders[:, a], b, orders[:, b], height]
        best = int(np.argmax(scores))
        order = tuple(orders[best].tolist())
        found[order] = max(found.get(order, 0.0), float(scores[best]))
    return sorted(((score, order) for order, score in found.items()), reverse=True)


def _by_height(
    judge: Judge,
    seen: Many[Seen | None],
    moments: Int[ndarray, " M"],
    reading: Reading,
    axis: Float[ndarray, " 3"],
) -> Float[ndarray, "C C C C H"]:
    """W by camera a, its calibration, camera b, its calibration, and height."""
    count = len(seen)
    poses = [pose(raw, reading) for raw in judge.cameras]
    centres = np.array([own.centre for own in poses])
    size = float(np.linalg.norm(np.ptp(centres, axis=0))) or 1.0
    counts = [np.array([]) if own is None else own.frames for own in seen]
    product = max(
        (
            sum(int((a == m).sum() * (b == m).sum()) for m in moments)
            for a, b in itertools.combinations(counts, 2)
        ),
        default=0,
    )
    moments = moments[:: 1 + product // _MOST_PAIRS]
    boxes: dict[tuple[int, int], tuple[Moments, ndarray, ndarray]] = {}
    for camera, calibration in itertools.product(range(count), range(count)):
        own = seen[camera]
        if own is None:
            continue
        lens, known = judge.lens_at(calibration, reading)
        four = boxes_by(own.four, reading, lens.image_size)
        up = poses[calibration].rotation @ axis
        at = at_moments(rays_of(own.frames, four, lens, known, up), moments)
        feet, heads = (in_world(poses[calibration], ends) for ends in (at.feet, at.heads))
        boxes[camera, calibration] = at, np.ascontiguousarray(feet), np.ascontiguousarray(heads)
    result = np.zeros((count, count, count, count, len(_HEIGHTS)))
    for a, b in itertools.combinations(range(count), 2):
        for k, l in itertools.permutations(range(count), 2):  # noqa: E741
            if (a, k) not in boxes or (b, l) not in boxes:
                continue
            one, feet, heads = boxes[a, k]
            other, other_feet, other_heads = boxes[b, l]
            result[a, k, b, l] = kernels.meeting_heights(
                feet, heads, one.whole, one.starts, other_feet, other_heads, other.whole,
                other.starts, (centres[l] - centres[k]) / size, axis, _HEIGHTS, LARGEST_GAP, SPREAD,
            )  # fmt: skip
    return result
