"""Targets in a foreground mask without any prior, from the tops of its components.

People stand; seen from the side, the crown of the head is on top, however many people one
connected component shows and whatever occludes their legs. The calibrated camera gives
the size of a target whose height above the floor is roughly known.

Where the number of people in each component is known from tracks,
:mod:`~tracker.single_view.association_matrix.silhouettes` fits that number: it accepts
poorer boxes for expected targets, and only very good ones beyond. Neither is of a paper: [WW10] and
[CMQ07] associate whole components, as the preset ``published`` does. They are two since this one
needs no tracks, which are of its measurements, and decides by three shares of foreground; that one
orders all candidates by one score.

Boxes are ``centre_x, centre_y, half_width, half_height`` in pixels.

[WW10] Wang, Wan, "Fast tracking of multiple targets in video by joint probabilistic
data association", patent CN101783020A, 2010.
[CMQ07] Chang, Ma, Qiao, "Human oriented multi-target tracking algorithm in video
sequence", Control and Decision 22(4), 2007.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, Int, UInt8
from numpy import ndarray
from scipy.ndimage import minimum_filter1d

from tracker.geometry.camera import Camera
from tracker.parameters.groups.jpda import JpdaParams
from tracker.sequences.sequence import Room
from tracker.single_view.box_sizes import BELOW_FLOOR, BoxSizes, outline_share, usual_heights
from tracker.single_view.pictures.foreground import Blobs, blobs, integral, shape_shares
from tracker.single_view.protocol import Dropped


@dataclass(frozen=True, slots=True, eq=False)
class Crowns:
    """The N targets of one mask."""

    boxes: Float[ndarray, "N 4"]
    """Boxes of the targets, pixels."""
    inside: Float[ndarray, " N"]
    """Share of foreground in each box, in that of a person's outline, 0 … 1."""
    pieces: Float[ndarray, "N 4"]
    """Box of the foreground component of each target, pixels."""
    dropped: Dropped
    """Tops that were rejected."""


class TargetSizes:
    """The median size of a target at each place of an image.

    A place that is the centre of targets at the heights of the entrances has their median size.
    Any other place has that of targets below these heights, for people who sit or bend; anything
    higher, such as an open door, is no target. In a room without entrances the heights are those
    of people on the floor, and the other places have the size of targets at any height.

    These are medians of :class:`~tracker.single_view.box_sizes.BoxSizes`: a top of a component is
    one candidate, while the methods that draw or try several sizes use its samples.
    """

    def __init__(
        self,
        camera: Camera,
        room: Room,
        half_extents: Float[ndarray, " 3"],
        height_sigmas: float,
    ) -> None:
        """Compute the sizes at each place.

        Args:
            camera: The calibrated camera.
            room: The room with its entrances.
            half_extents: Half width, depth and height of a target, metres.
            height_sigmas: Range of heights around the usual ones, in standard deviations.
        """
        upright, lower = (
            BoxSizes.of(camera, part, half_extents)
            for part in _height_ranges(room, float(half_extents[2]), height_sigmas)
        )
        self._grid, places = lower, lower.places()
        self.outline = outline_share(half_extents)
        """Share of a target's box that the outline of a person fills, 0 … 1."""
        standing, there = upright.typical(places)
        self._table = np.where(there[:, None], standing, lower.typical(places)[0])
        somewhere = np.isfinite(self._table[:, 0])
        self.middle = np.median(self._table[somewhere], axis=0) if somewhere.any() else np.ones(2)
        """Median half width and half height over all places, pixels."""

    def at(self, centres: Float[ndarray, "N 2"]) -> Float[ndarray, "N 2"]:
        """The half width and half height of a target at each place, pixels, NaN for none."""
        return np.asarray(self._table[self._grid.cells(centres)])

    def under(self, tops: Float[ndarray, "N 2"]) -> Float[ndarray, "N 2"]:
        """The sizes of targets with their crowns at each place, pixels."""
        half_heights = np.full(len(tops), self.middle[1])
        for _ in range(2):
            sizes = self.at(np.stack([tops[:, 0], tops[:, 1] + half_heights], axis=1))
            half_heights = np.where(np.isfinite(sizes[:, 1]), sizes[:, 1], half_heights)
        return sizes


def _height_ranges(room: Room, half_height: float, height_sigmas: float) -> tuple[Room, Room]:
    """The parts of the room's volume with the centres of upright targets, and of all targets."""
    means, sigmas = usual_heights(room, half_height)
    if not len(means):
        return room, room
    low, high = room.minimum.copy(), room.maximum.copy()
    # the volume of box sizes begins at the centre of a target on its floor
    low[2] = (means - height_sigmas * sigmas).min() - half_height + BELOW_FLOOR
    high[2] = (means + height_sigmas * sigmas).max()
    highest = high if room.entrances else room.maximum
    return Room(low, high), Room(room.minimum, highest)


def crowns(
    mask: UInt8[ndarray, "h w"], sizes: TargetSizes, minimum_area: int, parameters: JpdaParams
) -> Crowns:
    """Detect the targets of a mask by their heads and shoulders.

    Cracks across a component are closed. A column of a component is a top where its first pixel
    is the highest within a target's half width; the middle one of neighbouring tops is used. A
    target's box hangs from the top, centred on the pixels of its upper half. Boxes with
    too little foreground inside, or too much above or beside them, are rejected;
    so is a top at the shoulders of a higher one.

    Args:
        mask: The foreground mask, not 0 on the foreground.
        sizes: Possible sizes of targets in this camera.
        minimum_area: Area below which a component is ignored, pixels.
        parameters: Thresholds for a target under a top.
    """
    p = parameters
    crack = max(3, round(p.crack * float(sizes.middle[1])) | 1)
    closed = cv2.morphologyEx(
        (mask != 0).astype(np.uint8), cv2.MORPH_CLOSE, np.ones((crack, 3), np.uint8)
    )
    pieces = blobs(closed, minimum_area)
    found = [_tops(pieces, piece, sizes, p.top_reach) for piece in range(pieces.size)]
    boxes = np.concatenate([np.zeros((0, 4)), *found])
    owners = np.repeat(np.arange(pieces.size), [len(tops) for tops in found])
    inside, above, beside = shape_shares(integral(closed), boxes)
    inside = np.minimum(inside / sizes.outline, 1.0)
    full = inside >= p.least_inside
    good = full & (above <= p.most_above) & (beside <= p.most_beside)
    kept: list[int] = []
    for i in np.argsort(boxes[:, 1] - boxes[:, 3], kind="stable").tolist():
        apart = boxes[i, :2] - boxes[kept, :2]
        across = np.abs(apart[:, 0]) / np.maximum(boxes[kept, 2], boxes[i, 2])
        same = (across < p.shoulder_across) & (apart[:, 1] < p.shoulder_down * boxes[kept, 3])
        if good[i] and not same.any():
            kept.append(i)
    gates = {
        "foreground": ~full,
        "surroundings": full & ~good,
        "another's shoulders": good & ~np.isin(np.arange(len(good)), kept),
    }
    dropped = Dropped.of(boxes, gates)
    return Crowns(boxes[kept], inside[kept], pieces.boxes[owners[kept]], dropped)


def _tops(pieces: Blobs, piece: int, sizes: TargetSizes, top_reach: float) -> Float[ndarray, "N 4"]:
    """The boxes of targets under every top of one component."""
    x, y, half_width, half_height = pieces.boxes[piece]
    left, top = round(x - half_width + 0.5), round(y - half_height + 0.5)
    width, height = round(2.0 * half_width), round(2.0 * half_height)
    pixels = pieces.owners[top : top + height, left : left + width] == piece
    first = pixels.argmax(axis=0)
    half_sizes = sizes.under(np.stack([left + np.arange(width), top + first], axis=1).astype(float))
    possible = np.isfinite(half_sizes[:, 0])
    if not possible.any():
        return np.zeros((0, 4))
    reach = max(1, round(float(np.median(half_sizes[possible, 0]))))
    highest = (first == minimum_filter1d(first, 2 * reach + 1, mode="nearest")) & possible
    boxes = []
    for start, end in _runs(highest):
        column = (start + end - 1) // 2
        across, down = half_sizes[column]
        rows = slice(first[column], int(first[column] + down) + 1)
        begin = max(0, int(column - top_reach * across))
        upper = pixels[rows, begin : int(column + top_reach * across) + 1].sum(axis=0)
        centre = left + begin + float(upper @ np.arange(len(upper))) / upper.sum()
        boxes.append([centre, top + first[column] + down - 0.5, across, down])
    return np.array(boxes).reshape(-1, 4)


def _runs(flags: ndarray) -> Int[ndarray, "R 2"]:
    """First and one past the last index of each run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    return edges.reshape(-1, 2)
