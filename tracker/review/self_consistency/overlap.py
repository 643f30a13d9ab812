"""A camera that was left out as a witness: do its boxes lie where the others say people are?"""

from __future__ import annotations

from collections.abc import Sequence as Many

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.fusion.trajectories import Trajectories
from tracker.geometry.assignment import linear_sum_assignment
from tracker.geometry.camera import Camera
from tracker.single_view.protocol import ViewResult


def overlap(
    tracks: Trajectories,
    camera: Camera,
    half_extents: Float[ndarray, " 3"],
    views: Many[ViewResult],
) -> float | None:
    """Mean overlap (intersection over union) of a camera's boxes with people it did not find.

        2 Σ_pairs IoU / (boxes + people in the picture)

    with the best pairs of each step: 1 where every box lies on a person and the other way round.
    None without both. A step at which the camera had no frame says nothing.

    Args:
        tracks: Found without this camera.
        camera: It.
        half_extents: Of a person, metres.
        views: What it found at each step.
    """
    total, count = 0.0, 0
    for step, view in enumerate(views):
        if view.blind:
            continue
        boxes = view.boxes
        drawn, visible = camera.project_boxes(tracks.positions[tracks.at(step)], half_extents)
        drawn = drawn[visible]
        count += len(boxes) + len(drawn)
        if not len(boxes) or not len(drawn):
            continue
        low, high = drawn[:, None, :2], drawn[:, None, :2] + drawn[:, None, 2:]
        own_low, own_high = boxes[:, :2] - boxes[:, 2:], boxes[:, :2] + boxes[:, 2:]
        sides = np.minimum(high, own_high) - np.maximum(low, own_low)
        both = np.maximum(sides, 0.0).prod(axis=2)
        union = drawn[:, None, 2:].prod(axis=2) + 4.0 * boxes[:, 2:].prod(axis=1) - both
        shares = both / np.maximum(union, 1e-9)
        rows, columns = linear_sum_assignment(shares, maximize=True)
        total += 2.0 * float(shares[rows, columns].sum())
    return total / count if count else None
