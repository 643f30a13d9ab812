"""Segmentation of images into foreground and background, and shares of foreground in boxes.

There are two models behind :class:`~tracker.single_view.pictures.background.ForegroundModel`: one
learnt once from the clip, with a memory of motion for people who stay
(:mod:`~tracker.single_view.pictures.background`), and one whose thresholds and background adapt to
the images (:mod:`~tracker.single_view.pictures.adaptive`). The connected components of a mask are
the detections of a camera without a detector.

Boxes are ``centre_x, centre_y, half_width, half_height`` in pixels, where the centre
of the first pixel is (0, 0): a component of one pixel has half sizes of one half.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Float, Int, UInt8
from numpy import ndarray

from tracker.kernels.pictures import images
from tracker.parameters.groups.foreground import ForegroundParams
from tracker.sequences.pictures.frames import Pictures
from tracker.sequences.sequence import Sequence
from tracker.single_view.pictures.adaptive import AdaptiveForeground, first_background
from tracker.single_view.pictures.background import (
    BackgroundModel,
    ForegroundModel,
    LearntForeground,
    MovingForeground,
)

BACKGROUND_PICTURES = 32
"""Number of images spread over the clip from which a background is learnt: a median needs the scene
empty in half of them, and each takes time before the first step."""


def learn(
    sequence: Sequence,
    camera_index: int,
    reader: Pictures,
    parameters: ForegroundParams,
    *,
    motion: bool = False,
) -> ForegroundModel | None:
    """Learn the chosen foreground model of one camera; None without any image.

    Args:
        sequence: The sequence.
        camera_index: Index of the camera.
        reader: Reader of the images.
        parameters: The kind of model and its parameters.
        motion: Whether recent motion counts as foreground where the background is uncertain, for
            methods without other information about people.
    """

    # no parameter has an effect on a background, so that a change of one does not repeat it
    if parameters.model == "adaptive":
        follow = parameters.follow_exposure
        first = reader.once(
            ("first background", camera_index, follow),
            lambda: first_background(
                _empty(sequence, camera_index, reader) or _spread(sequence, camera_index, reader),
                follow_exposure=follow,
                check=reader.check,
            ),
        )
        return None if first is None else AdaptiveForeground(first, parameters)
    background = learn_background(sequence, camera_index, reader)
    if background is None:
        return None
    if motion:
        moving = MovingForeground(background, parameters, sequence.step_time)
        if moving.memory > 0:
            return moving
    return LearntForeground(background, parameters)


def learn_background(
    sequence: Sequence, camera_index: int, reader: Pictures
) -> BackgroundModel | None:
    """Learn the empty scene of one camera once; None without any image.

    Where the recording has an image of the empty scene, the clip is used only for the
    variation of its pixels.
    """

    def made() -> BackgroundModel | None:
        learnt = BackgroundModel.learn(_spread(sequence, camera_index, reader), reader.check)
        empty = BackgroundModel.learn(_empty(sequence, camera_index, reader), reader.check)
        if learnt is None or empty is None:
            return learnt
        return replace(learnt, picture=empty.picture, changing_share=0.0)

    return reader.once(("background", camera_index), made)


def _empty(
    sequence: Sequence, camera_index: int, reader: Pictures
) -> list[UInt8[ndarray, "h w 3"]]:
    """The images without people, where the recording names any."""
    empty_scene = sequence.views[camera_index].background
    if isinstance(empty_scene, range):
        return _spread(sequence, camera_index, reader, empty_scene)
    picture = reader.empty(camera_index)
    return [] if picture is None else [picture]


def _spread(
    sequence: Sequence, camera_index: int, reader: Pictures, among: range | None = None
) -> list[UInt8[ndarray, "h w 3"]]:
    """Images spread over the clip, or over some of its steps."""
    steps = spread_steps(range(sequence.frames) if among is None else among)
    found = (reader.picture(camera_index, step) for step in steps)
    return [picture for picture in found if picture is not None]


def spread_steps(among: range) -> list[int]:
    """The steps of the images from which a background is learnt."""
    count = min(BACKGROUND_PICTURES, len(among))
    steps: list[int] = np.linspace(among[0], among[-1], count).astype(int).tolist()
    return steps


LEAST_SHARE = 0.02
"""ε, a share that is added before the logarithm: an empty box costs a ln ε = -3.9 a and not
infinity."""

# in half sizes from a box's centre, left, top, right, bottom: inside, above, left and right. Gaps
# of 0.3 and 0.4 leave out what stands out of a box that is too small for its own person: heights
# vary by a tenth, of which 0.3 is three deviations, and arms add to the width. Beside, the parts
# end at the chest, since hands stand out below. Chosen by these reasons, not by a measurement.
_PARTS = np.array(
    [
        [-1.0, -1.0, 1.0, 1.0],
        [-1.0, -2.0, 1.0, -1.3],
        [-2.2, -1.0, -1.4, 0.3],
        [1.4, -1.0, 2.2, 0.3],
    ]
)


def integral(mask: UInt8[ndarray, "h w"]) -> Int[ndarray, "h1 w1"]:
    """Compute the integral image: sums above and left of each pixel corner (h + 1, w + 1)."""
    sums: ndarray = cv2.integral(mask)
    return sums


def box_shares(sums: Int[ndarray, "h1 w1"], edges: Float[ndarray, "N 4"]) -> Float[ndarray, " N"]:
    """Compute the share of foreground in rectangles given by left, top, right, bottom.

    Of a rectangle partly outside the image only the part inside is used; wholly
    outside the share is 0.

    Args:
        sums: Integral image of the mask, of :func:`integral`.
        edges: Left, top, right, bottom, pixels, not rounded.
    """
    shares: ndarray = images.box_means(sums, np.ascontiguousarray(edges, dtype=float))
    return shares


def shape_shares(
    sums: Int[ndarray, "h1 w1"], boxes: Float[ndarray, "N 4"]
) -> tuple[Float[ndarray, " N"], Float[ndarray, " N"], Float[ndarray, " N"]]:
    """Compute the shares of foreground inside boxes, above them, and beside their upper parts.

    Args:
        sums: Integral image of the mask, of :func:`integral`.
        boxes: Centre and half sizes of N boxes, pixels.
    """
    middles, half_sizes = boxes[:, [0, 1, 0, 1]], boxes[:, [2, 3, 2, 3]]
    inside, above, left, right = (box_shares(sums, middles + part * half_sizes) for part in _PARTS)
    return inside, above, (left + right) / 2.0


def shape_scores(
    sums: Int[ndarray, "h1 w1"],
    boxes: Float[ndarray, "N 4"],
    *,
    inside_weight: float,
    around_weight: float,
    outline: float = 1.0,
) -> tuple[Float[ndarray, " N"], Float[ndarray, " N"]]:
    """Compute log factors of the likelihood of boxes from the foreground, and shares inside.

    A box on a person is full of foreground, with background above and beside it:
    a ln(inside + ε) - b (above + beside), of :func:`shape_shares`, with ε = 0.02. A box that
    is as full as the outline of a person counts as full.

    Args:
        sums: Integral image of the mask, of :func:`integral`.
        boxes: Centre and half sizes of N boxes, pixels.
        inside_weight: a, the weight of the share inside.
        around_weight: b, the weight of the shares around.
        outline: Share of a box that the outline of a person fills, 0 … 1.
    """
    inside, above, beside = shape_shares(sums, boxes)
    inside = np.minimum(inside / outline, 1.0)
    return inside_weight * np.log(inside + LEAST_SHARE) - around_weight * (above + beside), inside


@dataclass(frozen=True, slots=True, eq=False)
class Blobs:
    """The components of a mask that are large enough, by the top edges of their boxes."""

    boxes: Float[ndarray, "N 4"]
    """The bounding box of each component."""
    areas: Int[ndarray, " N"]
    """Number of pixels of each component."""
    owners: Int[ndarray, "h w"]
    """Component of each pixel, 0 … N - 1; -1 for the background and for small components."""

    @property
    def size(self) -> int:
        """The number of components."""
        return len(self.areas)


def blobs(mask: UInt8[ndarray, "h w"], minimum_area: int) -> Blobs:
    """Find the components of a mask, connected over sides and corners.

    Args:
        mask: The foreground mask, not 0 on the foreground.
        minimum_area: Number of pixels below which a component is dropped.

    Raises:
        ValueError: If ``mask`` is not an image of one channel.
    """
    if mask.ndim != 2:
        raise ValueError(f"mask: expected (height, width), got shape {mask.shape}")
    if mask.size == 0:
        return Blobs(np.zeros((0, 4)), np.zeros(0, np.int64), np.full(mask.shape, -1, np.int32))
    binary = np.ascontiguousarray(mask != 0).view(np.uint8)
    count, labels, statistics, _ = cv2.connectedComponentsWithStats(binary, connectivity=8)
    kept = 1 + np.flatnonzero(statistics[1:, cv2.CC_STAT_AREA] >= minimum_area)
    order = np.lexsort(statistics[kept][:, [cv2.CC_STAT_LEFT, cv2.CC_STAT_TOP]].T)
    kept = kept[order]
    new_name = np.full(count, -1, dtype=np.int32)
    new_name[kept] = np.arange(len(kept))
    left, top, width, height, areas = statistics[kept].astype(np.int64).T
    boxes = np.stack(
        [left + (width - 1) / 2.0, top + (height - 1) / 2.0, width / 2.0, height / 2.0]
    )
    return Blobs(np.ascontiguousarray(boxes.T), areas, new_name[labels])
