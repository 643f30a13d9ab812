"""Agreement of two cameras' boxes as a function of the time offset between them."""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.geometry.camera import Camera
from tracker.geometry.consistency.likelihood import HEIGHT_SIGMA, SIGMA
from tracker.geometry.consistency.observed import Rays
from tracker.kernels import consistency

DEPTH_SIGMA = float(np.sqrt(HEIGHT_SIGMA**2 + 2.0 * SIGMA**2))
"""σ_λ: standard deviation of the logarithm of the distance that is estimated from a box's size, by
the deviations of its two ends and of people's heights in the likelihood of boxes. Between 0.12 and
0.3 no offset in the random rooms of seeds 1100 … 1117 changes by more than 0.1 steps."""

_LINKED = 0.5
"""Largest motion of a box's head or foot in a step, heights of the box. Between 0.25 and 1 no
offset in these rooms changes by more than 0.1 steps."""

_STEP = 0.05  # change of the logarithm of the distance for the numerical derivative


@dataclass(frozen=True, slots=True, eq=False)
class LinkedBoxes:
    """The D boxes of one camera over F steps, sorted by step."""

    camera: Camera
    """The calibrated camera."""
    rays: Rays
    """The boxes as rays to head and foot."""
    ends: Float[ndarray, "D 4"]
    """x and y of head and foot, pixels; NaN where the box is clipped."""
    starts: Int[ndarray, " F1"]
    """Index of the first box of each step, and D at the end."""
    following: Int[ndarray, " D"]
    """Index of the box of the same person one step later, -1 for none."""


def link_boxes(
    camera: Camera, rays: Rays, boxes: Float[ndarray, "D 4"], frames: int
) -> LinkedBoxes:
    """Link the boxes of a camera from step to step.

    Args:
        camera: The calibrated camera, in metres, z up.
        rays: Rays of its boxes, sorted by step.
        boxes: left, top, width, height, pixels, in the same order.
        frames: F, the number of steps of the camera.
    """
    middle = boxes[:, 0] + boxes[:, 2] / 2.0
    ends = np.stack([middle, boxes[:, 1], middle, boxes[:, 1] + boxes[:, 3]], axis=1)
    ends[~rays.whole] = np.nan
    starts = np.searchsorted(rays.frames, np.arange(frames + 1))
    return LinkedBoxes(camera, rays, ends, starts, _following(ends, starts))


def _following(ends: Float[ndarray, "D 4"], starts: Int[ndarray, " F1"]) -> Int[ndarray, " D"]:
    """Index of the box one step later that is each box's mutual nearest neighbour, -1 for none."""
    following = np.full(len(ends), -1, dtype=np.int64)
    for first, last, end in zip(starts[:-2], starts[1:-1], starts[2:], strict=True):
        if first == last or last == end:
            continue
        own, other = ends[first:last], ends[last:end]
        heights = np.minimum((own[:, 3] - own[:, 1])[:, None], (other[:, 3] - other[:, 1])[None])
        away = np.abs(own[:, None, :] - other[None, :, :]).max(axis=2) / heights
        away = np.where(np.isnan(away), np.inf, away)
        nearest, back = np.argmin(away, axis=1), np.argmin(away, axis=0)
        rows = np.arange(last - first)
        good = (back[nearest] == rows) & (away[rows, nearest] < _LINKED)
        following[first + rows[good]] = last + nearest[good]
    return following


def agreement_by_offset(
    one: LinkedBoxes,
    other: LinkedBoxes,
    offsets: Float[ndarray, " O"],
    height: float,
    most_steps: int = 150,
) -> tuple[Float[ndarray, "O S"], Float[ndarray, "O S"]]:
    """Compute the agreement of two cameras' boxes as a function of the time offset between them.

    The size of a box in camera ``one`` gives the person's distance, and so predicts the box in the
    other camera: across the epipolar line up to the noise, along it up to the error of that
    distance. :mod:`tracker.kernels.consistency` has the equation.

    Args:
        one: The boxes by which positions are predicted.
        other: The boxes that are compared, at step k + offset for those of ``one`` at step k.
        offsets: O offsets, steps; fractions are interpolated.
        height: Height of people, metres.
        most_steps: Largest number S of steps of ``one`` that are sampled evenly.

    Returns:
        For every offset and sampled step the sum of the predictions' fits, 0 … 1 each, and the
        number of predictions.
    """
    counts = np.diff(one.starts)
    steps = np.flatnonzero(counts)
    if len(steps) > most_steps:
        steps = steps[np.linspace(0, len(steps) - 1, most_steps).astype(int)]
    rows = np.concatenate(
        [np.zeros(0, dtype=np.int64), *(np.arange(*one.starts[k : k + 2]) for k in steps)]
    )
    starts = np.concatenate([[0], np.cumsum(counts[steps])])
    expected, tangents = _predicted_boxes(other.camera, one, rows, height)
    fits: tuple[ndarray, ndarray] = consistency.slide(
        expected, tangents, starts, steps, other.ends, other.following, other.starts,
        np.asarray(offsets, dtype=float), SIGMA, DEPTH_SIGMA,
    )  # fmt: skip
    return fits


def _predicted_boxes(
    camera: Camera, one: LinkedBoxes, rows: Int[ndarray, " N"], height: float
) -> tuple[Float[ndarray, "N 4"], Float[ndarray, "N 4"]]:
    """Predict heads and feet in another camera, and their derivatives by the log distance.

    Args:
        camera: The other camera.
        one: The boxes.
        rows: Indices of N boxes of ``one``.
        height: Height of people, metres.

    Returns:
        x and y of head and foot, pixels, NaN where not in the image; and their derivatives by the
        logarithm of the distance, pixels.
    """
    heads = one.rays.heads[rows] @ one.camera.rotation
    feet = one.rays.feet[rows] @ one.camera.rotation
    # the distances s and t of head and foot solve s u − t v = (0, 0, h) in the least squares
    together = (heads * feet).sum(axis=1)
    determinant = np.maximum(1.0 - together**2, 1e-9)
    s = height * (heads[:, 2] - together * feet[:, 2]) / determinant
    t = height * (together * heads[:, 2] - feet[:, 2]) / determinant
    ends: list[Many[ndarray]] = []
    for factor in (np.exp(-_STEP), 1.0, np.exp(_STEP)):
        places = [one.camera.centre + factor * far[:, None] * way
                  for far, way in ((s, heads), (t, feet))]  # fmt: skip
        ends.append([camera.project(place)[0] for place in places])
    nearer, middle, farther = (np.concatenate(both, axis=1) for both in ends)
    tangents = (farther - nearer) / (2.0 * _STEP)
    inside = one.rays.whole[rows] & (s > 0.0) & (t > 0.0) & np.isfinite(tangents).all(axis=1)
    inside &= camera.contains(middle[:, :2]) & camera.contains(middle[:, 2:])
    expected = np.where(inside[:, None], middle, np.nan)
    return np.ascontiguousarray(expected), np.ascontiguousarray(tangents)
