"""Boxes of an external detector: their measurement noise, and their consistency with the room.

A detector gives the ends of an upright target, which determine its place in the room; the sizes of
:mod:`~tracker.single_view.box_sizes` are for boxes that are sought in the image.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Bool, Float, Float16, Int
from numpy import ndarray

from tracker.geometry.boxes import Boxes
from tracker.geometry.camera import Camera
from tracker.parameters.groups.detections import DetectionBoxParams
from tracker.sequences.sequence import Room, Sequence
from tracker.single_view.protocol import OUTSIDE, Dropped, ViewResult

if TYPE_CHECKING:
    from tracker.parameters.catalogue import RunParameters
    from tracker.sequences.pictures.frames import Pictures


_AT_ONCE = 4096
"""Number of boxes whose places in the room are in memory at a time."""

_LEAST_SHARE = 0.05
"""Least ratio of the expected height to that of a box: however much too tall a box may be, its
target is at most 20 times as far away as it says, so that the place is finite."""


@dataclass(frozen=True, slots=True, eq=False)
class Detected:
    """The N boxes of one camera at one step with a sufficient score."""

    boxes: Float[ndarray, "N 4"]
    """centre_x, centre_y, half_width, half_height, pixels."""
    scores: Float[ndarray, " N"]
    """Score of the detector, 0 … 1."""
    sigmas: Float[ndarray, "N 4"]
    """Standard deviations of the same four numbers, pixels."""
    plausible: Bool[ndarray, " N"]
    """Whether the box is consistent with the room; other boxes are clutter."""
    embeddings: Float16[ndarray, "N A"] = field(
        default_factory=lambda: np.zeros((0, 0), np.float16)
    )
    """Embedding of each box's appearance, a unit vector; (0, 0) where there is none."""

    def take(self, rows: slice) -> Detected:
        """Select some of the boxes."""
        embeddings = self.embeddings_of(rows)
        return Detected(
            self.boxes[rows], self.scores[rows], self.sigmas[rows], self.plausible[rows], embeddings
        )

    @property
    def dropped(self) -> Dropped:
        """The boxes that contradict the room."""
        return Dropped.of(self.boxes, {OUTSIDE: ~self.plausible})

    @property
    def result(self) -> ViewResult:
        """The result of a method that passes the boxes on: those that contradict the room remain
        among the measurements alone."""
        good, dropped = self.plausible, self.dropped
        return replace(
            ViewResult.of_boxes(self.boxes[good], self.scores[good], self.sigmas[good]),
            embeddings=self.embeddings_of(good),
            measurements=self.boxes,
            measurement_scores=self.scores,
            information=dropped.information(int(good.sum())),
            dropped=dropped,
        )

    def embeddings_of(
        self, chosen: slice | Bool[ndarray, " N"] | Int[ndarray, " K"]
    ) -> Float16[ndarray, "K A"]:
        """The embeddings of some of the boxes; (0, 0) where there are none."""
        return self.embeddings[chosen] if self.embeddings.shape[1] else self.embeddings


class DetectorBoxes:
    """The ``detections`` of one camera, with the measurement noise of the parameters."""

    def __init__(
        self, sequence: Sequence, camera_index: int, parameters: DetectionBoxParams
    ) -> None:
        """Select the boxes of one camera.

        Raises:
            ValueError: If the camera has no detections.
        """
        view = sequence.views[camera_index]
        if view.detections is None:
            raise ValueError(
                f'camera "{view.camera.name}" of {sequence.name} has no detections; name a CSV '
                "file as its `detections` in sequence.toml, or a single_view that needs no boxes"
            )
        p, all_boxes = parameters, view.detections
        above = all_boxes.scores >= p.score_threshold
        self._frames = all_boxes.frames[above]
        found = judge_boxes(
            sequence, view.camera, all_boxes.boxes[above], all_boxes.scores[above], p
        )
        embeddings = all_boxes.embeddings
        if embeddings.shape[1]:
            embeddings = embeddings[above]
        self._found = replace(found, embeddings=embeddings)
        """The boxes of all steps, computed at once: the consistency of a box depends on no
        other."""

    def at(self, frame: int) -> Detected:
        """The boxes of one step."""
        first, last = np.searchsorted(self._frames, [frame, frame + 1])
        return self._found.take(slice(int(first), int(last)))


def judge_boxes(
    sequence: Sequence,
    camera: Camera,
    boxes: Float[ndarray, "N 4"],
    scores: Float[ndarray, " N"],
    parameters: DetectionBoxParams,
) -> Detected:
    """Compute measurement noise and consistency of a detector's boxes.

    Args:
        sequence: The sequence, with the room and the target.
        camera: The camera of the boxes.
        boxes: left, top, width, height of N boxes, pixels.
        scores: Score of each box, 0 … 1.
        parameters: The parameters of the noise and of the consistency.
    """
    p, centred = parameters, Boxes.from_left_top(boxes).centred
    sigmas = detector_sigmas(centred, p)
    plausible = np.zeros(len(centred), dtype=bool)
    for first in range(0, len(centred), _AT_ONCE):
        some = slice(first, first + _AT_ONCE)
        nearest, farthest = standing_range(
            camera,
            centred[some],
            float(sequence.target_half_extents[2]),
            p.depth_sigmas * sigmas[some, 3] / centred[some, 3],
        )
        plausible[some] = meets_room(sequence.room, nearest, farthest, p.room_tolerance)
    return Detected(_clip_to_image(centred, camera), scores, sigmas, plausible)


def _clip_to_image(boxes: Float[ndarray, "N 4"], camera: Camera) -> Float[ndarray, "N 4"]:
    """Clip top and bottom of the boxes to the image, as the measurement model expects them.

    Some detectors and annotations have boxes of whole persons also at the edge of the image; a
    box that lies wholly outside is not changed.
    """
    last = camera.image_size[1] - 1.0
    top = np.clip(boxes[:, 1] - boxes[:, 3], 0.0, last)
    bottom = np.clip(boxes[:, 1] + boxes[:, 3], 0.0, last)
    inside = bottom > top
    within = boxes.copy()
    within[inside, 1] = ((top + bottom) / 2.0)[inside]
    within[inside, 3] = ((bottom - top) / 2.0)[inside]
    return within


def detector_sigmas(
    boxes: Float[ndarray, "N 4"], parameters: DetectionBoxParams
) -> Float[ndarray, "N 4"]:
    """Compute the measurement noise of boxes: a share of their size and a constant, in quadrature.

    Args:
        boxes: centre_x, centre_y, half_width, half_height, pixels.
        parameters: The shares, and the constant in pixels.

    Returns:
        Standard deviations of the same four numbers, pixels.
    """
    p = parameters
    half_width, half_height = boxes[:, 2], boxes[:, 3]
    shares = [
        p.centre_sigma * half_height,
        p.centre_sigma * half_height,
        p.width_sigma * half_width,
        p.size_sigma * half_height,
    ]
    return np.hypot(np.stack(shares, axis=1), p.pixel_sigma)


def standing_range(
    camera: Camera,
    boxes: Float[ndarray, "N 4"],
    half_height: float,
    relative_error: Float[ndarray, " N"],
) -> tuple[Float[ndarray, "N 3"], Float[ndarray, "N 3"]]:
    """Compute the nearest and the farthest place of an upright target that gives each box.

    The rays through the middle of the box's top and of its bottom, the other way round for a
    camera upside down, meet an upright segment of the target's height where

        s u − t v = (0, 0, 2h)

    in the least squares; the middle of the segment lies on a ray from the lens,
    and an error of the box's height moves it along that ray in proportion.

    Args:
        camera: The calibrated camera.
        boxes: centre_x, centre_y, half_width, half_height, pixels.
        half_height: h, metres.
        relative_error: Largest relative error of a box's height; from 1 on a box that is
            far too tall may belong to a target at any distance.

    Returns:
        The nearest and the farthest place of the target's centre, world metres.
    """
    # in the picture of a camera that hangs upside down, heads are at the bottoms of the boxes
    down = [0.0, 1.0 if camera.rotation[1, 2] <= 0.0 else -1.0]
    heads = camera.back_project(boxes[:, :2] - boxes[:, 3:] * down)
    feet = camera.back_project(boxes[:, :2] + boxes[:, 3:] * down)
    together = (heads * feet).sum(axis=1)
    rise = 2.0 * half_height
    # the normal equations of [u, −v] [s; t] = (0, 0, 2h), for unit vectors
    determinant = np.maximum(1.0 - together**2, 1e-12)
    s = rise * (heads[:, 2] - together * feet[:, 2]) / determinant
    t = rise * (together * heads[:, 2] - feet[:, 2]) / determinant
    middle = (s[:, None] * heads + t[:, None] * feet) / 2.0
    nearest = camera.centre + middle / (1.0 + relative_error)[:, None]
    farthest = camera.centre + middle / np.maximum(1.0 - relative_error, _LEAST_SHARE)[:, None]
    return nearest, farthest


def meets_room(
    room: Room, starts: Float[ndarray, "N 3"], ends: Float[ndarray, "N 3"], margin: float
) -> Bool[ndarray, " N"]:
    """Whether each segment comes within ``margin`` metres of the room's volume, axis by axis.

    Args:
        room: The room, whose volume is used.
        starts: First end of each segment, world metres.
        ends: Second end of each segment, world metres.
        margin: Distance by which the volume is extended on all sides, metres.
    """
    low, high = room.minimum - margin, room.maximum + margin
    way = ends - starts
    with np.errstate(divide="ignore", invalid="ignore"):
        first, second = (low - starts) / way, (high - starts) / way
    # a line parallel to a pair of walls is between them everywhere or nowhere
    still = np.abs(way) < 1e-12
    between = (starts >= low) & (starts <= high)
    enter = np.where(still, np.where(between, 0.0, np.inf), np.minimum(first, second))
    leave = np.where(still, 1.0, np.maximum(first, second))
    entered = np.maximum(enter.max(axis=1), 0.0)
    return np.asarray(entered <= np.minimum(leave.min(axis=1), 1.0))


class UnfilteredBoxes:
    """The boxes of the sequence's ``detections``, with the noise of the parameters.

    Boxes that contradict the room remain among the measurements and are not passed on.
    """

    def __init__(
        self,
        sequence: Sequence,
        camera_index: int,
        parameters: RunParameters,
        reader: Pictures | None = None,
    ) -> None:
        """Prepare the boxes of one camera.

        Raises:
            ValueError: If the camera has no detections.
        """
        self._boxes = DetectorBoxes(sequence, camera_index, parameters.of(DetectionBoxParams))

    def start(self) -> None:
        """The method has no state."""

    def step(
        self, state: None, frame: int, picture: ndarray | None, rng: np.random.Generator
    ) -> tuple[None, ViewResult]:
        """Return the boxes of one step with a sufficient score and a possible place."""
        return None, self._boxes.at(frame).result
