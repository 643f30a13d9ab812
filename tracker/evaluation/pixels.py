"""The evaluation in each camera's picture: projected estimates against the projected truth.

Estimates and true positions become picture boxes by the same projection of the
same upright box, so the figures measure the position error as it appears in the
picture, not how well a box fits a silhouette. Only boxes that overlap the picture
count, on both sides; they are not clipped to it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.evaluation.figures import Definition, mean
from tracker.evaluation.matching import Comparison, Rows, assign
from tracker.evaluation.positions import Errors
from tracker.geometry.boxes import box_overlaps
from tracker.geometry.camera import Camera


@dataclass(frozen=True, slots=True, eq=False)
class CameraScore(Errors):
    """The errors of the boxes in one camera's pictures: distances of centres, pixels."""

    camera: str
    """The name of the camera."""
    overlaps: Float[ndarray, " M"]
    """Intersection over union of each pair."""

    @property
    def overlap(self) -> float | None:
        """Mean intersection over union of the pairs; None without pairs."""
        return mean(self.overlaps)


PICTURES: tuple[Definition[CameraScore], ...] = (
    Definition("pixel_error", "Pixel error", "Pictures", "px", "lower", 2, ("overlap",),
        "Mean distance of the centres of reprojected and true boxes, all cameras together.",
        lambda c: c.error),
    Definition("pixel_overlap", "Box overlap", "Pictures", "", "higher", 3, ("overlap",),
        "Mean intersection over union of the paired boxes, all cameras together.",
        lambda c: c.overlap),
    Definition("pixel_found", "Boxes found", "Pictures", "", "higher", 3, ("overlap",),
        "Share of the true boxes in the pictures that have a pair, all cameras together.",
        lambda c: c.found_share),
)  # fmt: skip


def _seen(
    rows: Rows, camera: Camera, half_extents: Float[ndarray, " 3"]
) -> tuple[Float[ndarray, "V 4"], list[int]]:
    """Return the boxes that overlap the picture, sorted by step, and the first index of each
    step."""
    boxes, visible = camera.project_boxes(rows.positions, half_extents)
    starts = np.searchsorted(rows.frames[visible], np.arange(rows.steps + 1))
    return boxes[visible], starts.tolist()


def pixels(
    comparison: Comparison,
    cameras: Sequence[Camera],
    *,
    overlap: float,
) -> tuple[CameraScore, ...]:
    """Score the boxes in every camera's picture.

    At each step the boxes of one picture are paired one to one by the protocol of
    :mod:`tracker.evaluation.matching`, with the distance 1 − IoU and the gate
    1 − ``overlap``. Estimates that matched a don't-care row in space are not in the comparison.

    Args:
        comparison: Truth and estimates.
        cameras: The calibrated cameras; without any there are no scores.
        overlap: The least intersection over union of a pair, in (0, 1).
    """
    scores, size = [], comparison.measure.half_extents
    for camera in cameras:
        truth, truth_starts = _seen(comparison.truth, camera, size)
        boxes, box_starts = _seen(comparison.tracks, camera, size)
        errors, overlaps = [np.zeros(0)], [np.zeros(0)]
        for step in range(comparison.steps):
            here = truth[truth_starts[step] : truth_starts[step + 1]]
            reported = boxes[box_starts[step] : box_starts[step + 1]]
            shared = box_overlaps(here, reported)
            rows, columns = assign(1.0 - shared, 1.0 - overlap)
            first, second = here[rows], reported[columns]
            apart = first[:, :2] + first[:, 2:] / 2.0 - second[:, :2] - second[:, 2:] / 2.0
            errors.append(np.hypot(apart[:, 0], apart[:, 1]))
            overlaps.append(shared[rows, columns])
        scores.append(
            CameraScore(
                camera=camera.name,
                errors=np.concatenate(errors),
                overlaps=np.concatenate(overlaps),
                people=len(truth),
                found=sum(map(len, errors)),
                estimates=len(boxes),
                steps=comparison.steps,
            )
        )
    return tuple(scores)


def together(scores: Sequence[CameraScore]) -> CameraScore:
    """Return the errors of all cameras together."""
    none = [np.zeros(0)]
    return CameraScore(
        camera="all",
        errors=np.concatenate(none + [score.errors for score in scores]),
        overlaps=np.concatenate(none + [score.overlaps for score in scores]),
        people=sum(score.people for score in scores),
        found=sum(score.found for score in scores),
        estimates=sum(score.estimates for score in scores),
        steps=sum(score.steps for score in scores),
    )
