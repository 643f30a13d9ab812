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

from tracker.evaluation.measures.matching import Comparison, Rows, assign
from tracker.geometry.boxes import box_overlaps
from tracker.geometry.camera import Camera


@dataclass(frozen=True, slots=True, eq=False)
class CameraScore:
    """The scores of one camera's boxes."""

    camera: str
    """The name of the camera."""
    errors: Float[ndarray, " M"]
    """Distance of the box centres of each pair, pixels."""
    overlaps: Float[ndarray, " M"]
    """Intersection over union of each pair."""
    people: int
    """The number of true boxes in the picture, over all steps."""
    estimates: int
    """The number of reprojected boxes in the picture, over all steps."""
    steps: int
    """The number of steps that are scored."""

    @property
    def error(self) -> float | None:
        """Mean distance of the centres, pixels; None without pairs."""
        return float(self.errors.mean()) if len(self.errors) else None

    @property
    def error_95(self) -> float | None:
        """95th percentile of the distance of the centres, pixels; None without pairs."""
        return float(np.percentile(self.errors, 95)) if len(self.errors) else None

    @property
    def overlap(self) -> float | None:
        """Mean intersection over union of the pairs; None without pairs."""
        return float(self.overlaps.mean()) if len(self.overlaps) else None

    @property
    def found_share(self) -> float | None:
        """Share of the true boxes that have a pair; None without true boxes."""
        return len(self.errors) / self.people if self.people else None

    @property
    def false_per_picture(self) -> float | None:
        """Mean number of reprojected boxes without a pair in a picture; None without steps."""
        return (self.estimates - len(self.errors)) / self.steps if self.steps else None


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
    half_extents: Float[ndarray, " 3"],
    *,
    overlap: float,
) -> tuple[CameraScore, ...]:
    """Score the boxes in every camera's picture.

    At each step the boxes of one picture are paired one to one by the protocol of
    :mod:`tracker.evaluation.measures.matching`, with the distance 1 − IoU and the gate
    1 − ``overlap``. Estimates that matched a don't-care row in space are not in the comparison.

    Args:
        comparison: Truth and estimates.
        cameras: The calibrated cameras; without any there are no scores.
        half_extents: Half width, depth and height of a target, metres.
        overlap: The least intersection over union of a pair, in (0, 1).
    """
    scores = []
    for camera in cameras:
        truth, truth_starts = _seen(comparison.truth, camera, half_extents)
        boxes, box_starts = _seen(comparison.tracks, camera, half_extents)
        errors, overlaps = [np.zeros(0)], [np.zeros(0)]
        for step in range(comparison.steps):
            here = truth[truth_starts[step] : truth_starts[step + 1]]
            reported = boxes[box_starts[step] : box_starts[step + 1]]
            if not len(here) or not len(reported):
                continue
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
                estimates=len(boxes),
                steps=comparison.steps,
            )
        )
    return tuple(scores)
