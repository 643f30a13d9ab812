"""Possible sizes of a target's box at each place of an image, from the calibrated camera.

The way is from the room to the image: positions in the volume are projected. Three others differ:
the windows of :mod:`~tracker.single_view.shape.finder` hang from crowns above the floor, around
head and trunk, as those of the training set; :mod:`~tracker.single_view.colour.carrying` goes from
one drawn box to the room, along the ray of its centre, since a target may be a head without feet;
and :mod:`~tracker.single_view.detector_boxes` by both ends of a box.

[DC66] Drillis, Contini, "Body segment parameters", Office of Vocational Rehabilitation, 1966.
[NCD16] NCD Risk Factor Collaboration, "A century of trends in adult human height", eLife 5, 2016.
[Rob18] Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.filters import models
from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.geometry.camera import Camera
from tracker.sequences.sequence import Room, Sequence

CELLS = 24
"""Number of cells along the longer side of the image: sizes hardly change within one, and each
still contains some hundred of the positions."""

POSITIONS = 60_000
"""Number of positions in the room that are projected for each camera: enough for every cell."""

AT_USUAL_HEIGHT, HEIGHT_FACTOR = 0.9, 2.0
"""Share of the positions at the usual heights, and the factor on those heights' spread: some people
sit or bend, and entrances are drawn by eye. A tenth leaves 6,000 positions for all other
heights, ten and more in a cell, and twice the spread is generous. Neither was measured."""

STATURE = 1.65
"""Mean height of standing adults, women and men together, metres ([NCD16])."""

CROWN, CROWN_SIGMA = 1.55, 0.2
"""Mean and standard deviation of the heights of people's crowns, metres: nearly all are between
those of people who sit on chairs (1.2 m) and of tall ones who stand (1.9 m)."""

OUTLINE = ((0.13, 0.10), (0.47, 0.195), (1.0, 0.11))
"""Head, trunk with arms, and legs: their lower ends below the crown, and their mean widths seen
from all sides, in statures. Lengths and widths from the front are those of [DC66]; the mean width
of a convex outline is its circumference over pi (Cauchy), here that of an ellipse half as deep."""

_DRAWN, _LEAST_SEEN = 500, 10
"""Number of targets that are drawn from an entrance, for the moments of their boxes, and the number
of visible ones below which the entrance is outside the image."""

_PEOPLE_DIFFER = 0.1
"""Standard deviation of people's sizes, as a share, as of the samples (``size_jitter``)."""

BELOW_FLOOR = 0.1
"""Extent of a target below the room's volume that is allowed, for a floor drawn by eye, metres."""


def geometry_key(sequence: Sequence, camera_index: int) -> Hashable:
    """A key of cached data that depends on the camera, the room and the target.

    Data that depend on the images alone do not need it: they remain when a user moves the room's
    walls.

    Args:
        sequence: The room and the target.
        camera_index: Index of the camera.
    """
    camera, room = sequence.cameras[camera_index], sequence.room
    lens = camera.calibration
    numbers = (
        *(lens.rotation, lens.translation, lens.intrinsics, lens.distortion),
        *(room.minimum, room.maximum, sequence.target_half_extents),
    )
    return (camera.image_size, *(number.tobytes() for number in numbers))


def upright_boxes(
    camera: Camera, positions: Float[ndarray, "N 3"], half_extents: Float[ndarray, "*N 3"]
) -> tuple[Float[ndarray, "N 4"], Bool[ndarray, " N"]]:
    """Project upright targets that face the camera to boxes.

    The centre is the projection of the target's centre, the half sizes are half the projections
    of its width (the mean of the two horizontal extents, seen from the front) and of its
    height. Boxes drawn by hand around a head or a body are like that; the bounds of
    the corners of a cuboid are wider.

    Args:
        camera: The calibrated camera.
        positions: Centres of N targets, world metres.
        half_extents: Half width, depth and height, metres, of all or of each.

    Returns:
        ``centre_x, centre_y, half_width, half_height`` in pixels, NaN where invalid;
        and whether the whole target is in front of the lens with its centre in the image.
    """
    right = camera.rotation[0] * [1.0, 1.0, 0.0]
    norm = np.linalg.norm(right)
    right = right / norm if norm > 1e-9 else np.array([1.0, 0.0, 0.0])
    across = right * (half_extents[..., :1] + half_extents[..., 1:2]) / 2.0
    up = np.array([0.0, 0.0, 1.0]) * half_extents[..., 2:]
    points = np.concatenate(
        [positions, positions - across, positions + across, positions - up, positions + up]
    )
    pixels, valid = camera.project(points)
    centre, left, right_edge, low, high = pixels.reshape(5, -1, 2)
    boxes = np.empty((len(positions), 4))
    boxes[:, :2] = centre
    boxes[:, 2] = np.linalg.norm(right_edge - left, axis=1) / 2.0
    boxes[:, 3] = np.linalg.norm(high - low, axis=1) / 2.0
    whole = valid.reshape(5, -1).all(axis=0)
    boxes[~whole] = np.nan
    return boxes, whole & camera.contains(boxes[:, :2])


def outline_share(half_extents: Float[ndarray, " 3"]) -> float:
    """The share of a target's box that the outline of a standing person fills on average, 0 … 1.

    The box hangs from the crown. A box around a head or a trunk is nearly full; one around a whole
    body, as wide as its arms reach, is for the most part empty.

    Args:
        half_extents: Half width, depth and height of a target, metres.
    """
    width, height = half_extents[0] + half_extents[1], 2.0 * half_extents[2]
    ends, widths = np.array(OUTLINE).T * max(STATURE, height)
    lengths = np.diff(np.minimum(ends, height), prepend=0.0)
    return float((lengths * np.minimum(widths, width)).sum() / (width * height))


@dataclass(frozen=True, slots=True, eq=False)
class BoxSizes:
    """The sizes of targets anywhere in the room, by the cell of the image with their centre."""

    cell: float
    """Side of a cell, pixels."""
    columns: int
    """Number of cells across."""
    rows: int
    """Number of cells down."""
    starts: Int[ndarray, " cells1"]
    """Index of the first size of each cell, and P at the end."""
    sizes: Float[ndarray, "P 2"]
    """Half width and half height, pixels, cell by cell."""
    smallest: Float[ndarray, " 2"]
    """Smallest half width and half height, pixels; 1 without any position in the image."""
    largest: Float[ndarray, " 2"]
    """Largest half width and half height, pixels; 2 without any position in the image."""

    @staticmethod
    def of(
        camera: Camera,
        room: Room,
        half_extents: Float[ndarray, " 3"],
        *,
        at_usual_heights: bool = False,
    ) -> BoxSizes:
        """Project positions spread evenly over the room's volume.

        Args:
            camera: The calibrated camera.
            room: The room, with volume and entrances.
            half_extents: Half width, depth and height of a target, metres.
            at_usual_heights: Whether most positions are at the heights of :func:`usual_heights`,
                which do not change much for a person, rather than at any height.
        """
        width, height = camera.image_size
        cell = max(width, height) / CELLS
        columns, rows = int(np.ceil(width / cell)), int(np.ceil(height / cell))
        low = room.minimum.copy()
        low[2] = min(low[2] + half_extents[2] - BELOW_FLOOR, room.maximum[2])
        positions = low + _even_points(POSITIONS) * (room.maximum - low)
        if at_usual_heights:
            _bring_to_usual_heights(positions, *usual_heights(room, float(half_extents[2])))
        boxes, visible = upright_boxes(camera, positions, half_extents)
        boxes = boxes[visible]
        place = _cells(boxes[:, :2], cell, columns, rows)
        order = np.argsort(place, kind="stable")
        starts = np.searchsorted(place[order], np.arange(columns * rows + 1))
        sizes = boxes[order, 2:]
        smallest = sizes.min(axis=0) if len(sizes) else np.ones(2)
        largest = sizes.max(axis=0) if len(sizes) else np.full(2, 2.0)
        return BoxSizes(cell, columns, rows, starts, sizes, smallest, largest)

    def contains(self, centres: Float[ndarray, "N 2"]) -> Bool[ndarray, " N"]:
        """Whether the centre of a target can be at each place, pixels."""
        place = _cells(centres, self.cell, self.columns, self.rows)
        return np.asarray(self.starts[place + 1] > self.starts[place])

    def cells(self, centres: Float[ndarray, "N 2"]) -> Int[ndarray, " N"]:
        """The cell of each place, pixels; the nearest one for a place outside the image."""
        return _cells(centres, self.cell, self.columns, self.rows)

    def places(self) -> Float[ndarray, "cells 2"]:
        """The centre of each cell, pixels."""
        rows, columns = np.indices((self.rows, self.columns)).reshape(2, -1)
        return np.stack([columns, rows], axis=1) * self.cell + (self.cell - 1.0) / 2.0

    def quantiles(
        self, count: int
    ) -> tuple[Float[ndarray, "cells count 2"], Bool[ndarray, " cells"]]:
        """Quantiles of the sizes in each cell, from small to large, and whether it has any size.

        Args:
            count: Number of quantiles: the medians of as many equally likely parts.
        """
        number = np.diff(self.starts)
        shares = (np.arange(count) + 0.5) / count
        ranks = self.starts[:-1, None] + (shares * number[:, None]).astype(np.int64)
        cell = np.repeat(np.arange(len(number)), number)
        ordered = self.sizes[np.lexsort([self.sizes[:, 1], cell])]
        there = np.asarray(number > 0)
        table = np.zeros((len(number), count, 2))
        table[there] = ordered[ranks[there]]
        return table, there

    def typical(
        self, centres: Float[ndarray, "N 2"]
    ) -> tuple[Float[ndarray, "N 2"], Bool[ndarray, " N"]]:
        """The median size at each place, pixels, and whether there is one (else NaN)."""
        places = _cells(centres, self.cell, self.columns, self.rows)
        cells, owners = np.unique(places, return_inverse=True)
        middles = np.full((len(cells), 2), np.nan)
        for i, cell in enumerate(cells):
            there = self.sizes[self.starts[cell] : self.starts[cell + 1]]
            if len(there):
                middles[i] = np.median(there, axis=0)
        sizes = middles[owners.reshape(-1)]
        return sizes, np.isfinite(sizes[:, 0])

    def draw(
        self, centres: Float[ndarray, "N 2"], rng: np.random.Generator
    ) -> tuple[Float[ndarray, "N 2"], Bool[ndarray, " N"]]:
        """Draw a possible size of a target at each place.

        Args:
            centres: N places in the image, pixels.
            rng: The generator of the draws.

        Returns:
            Half width and half height, pixels, NaN where no target can be; and whether one can be.
        """
        place = _cells(centres, self.cell, self.columns, self.rows)
        first, count = self.starts[place], self.starts[place + 1] - self.starts[place]
        chosen = first + (rng.random(len(centres)) * count).astype(np.int64)
        sizes = np.full((len(centres), 2), np.nan)
        possible = count > 0
        sizes[possible] = self.sizes[chosen[possible]]
        return sizes, possible


def usual_heights(
    room: Room, half_height: float
) -> tuple[Float[ndarray, " E"], Float[ndarray, " E"]]:
    """Means and standard deviations of the heights of targets' centres, world metres.

    They are those of the entrances. Without entrances they are one pair, that of people on the
    floor: the target is below the crown of somebody who sits or stands, or, where it is a whole
    body, reaches up from the floor. A room that is too low for them has none.

    Args:
        room: The room, whose volume holds the centres of targets.
        half_height: Half height of a target, metres.
    """
    if room.entrances:
        heights = [(entrance.position[2], entrance.sigma[2]) for entrance in room.entrances]
    else:
        # a body's centre is at half the height of its crown, and varies half as much
        hanging, standing = (CROWN - half_height, CROWN_SIGMA), (half_height, CROWN_SIGMA / 2.0)
        above, sigma = max(hanging, standing)
        height = room.minimum[2] + above
        heights = [(height, sigma)] if height <= room.maximum[2] else []
    means, sigmas = np.array(heights, dtype=float).reshape(-1, 2).T
    return means, sigmas


def _bring_to_usual_heights(
    positions: Float[ndarray, "N 3"], means: Float[ndarray, " E"], sigmas: Float[ndarray, " E"]
) -> None:
    """Move most of the positions to some heights, in turn, in place."""
    moved = positions[: round(AT_USUAL_HEIGHT * len(positions))]
    spread = _normals(_even_points(len(moved))[:, 2])
    for number, (mean, sigma) in enumerate(zip(means, sigmas, strict=True)):
        own = slice(number, None, len(means))
        moved[own, 2] = mean + HEIGHT_FACTOR * sigma * spread[own]


def _even_points(count: int) -> Float[ndarray, "N 3"]:
    """Points that fill the unit cube evenly: the additive recurrence R₃ of [Rob18]."""
    growth = 1.2207440846057596  # the positive root of x⁴ = x + 1
    steps = np.arange(1, count + 1)[:, None] * growth ** -np.arange(1.0, 4.0)
    return steps % 1.0


def _normals(points: Float[ndarray, " *S"]) -> Float[ndarray, " *S"]:
    """The quantiles of the standard normal distribution for some probabilities."""
    from scipy.special import ndtri  # a server starts without it

    normals: Float[ndarray, " *S"] = ndtri(points)
    return normals


def _cells(
    centres: Float[ndarray, "N 2"], cell: float, columns: int, rows: int
) -> Int[ndarray, " N"]:
    """The cell of each place, pixels; the nearest one for a place outside the image."""
    column = np.clip((centres[:, 0] + 0.5) // cell, 0, columns - 1).astype(np.int64)
    row = np.clip((centres[:, 1] + 0.5) // cell, 0, rows - 1).astype(np.int64)
    return row * columns + column


def entrance_boxes(
    camera: Camera, room: Room, half_extents: Float[ndarray, " 3"], weight: float
) -> GaussianMixture:
    """The birth intensity in a camera: one Gaussian over boxes for each visible entrance.

    Mean and covariance are those of the boxes of targets drawn from the entrance.
    A room without entrances gives one component over its visible volume.

    Args:
        camera: The calibrated camera.
        room: The room, whose entrances have mean and standard deviation in metres.
        half_extents: Half width, depth and height of a target, metres.
        weight: Weight of each component, expected number of targets.

    Returns:
        At most as many components as entrances, centre and half sizes in pixels; none where no
        entrance is visible.
    """
    births = models.entrance_births(room, weight)
    normals = _normals(_even_points(_DRAWN))
    means, covariances = [], []
    for mean, covariance in zip(births.means, births.covariances, strict=True):
        positions = mean + normals * np.sqrt(np.diag(covariance))
        boxes, visible = upright_boxes(camera, positions, half_extents)
        if visible.sum() < _LEAST_SEEN:
            continue
        means.append(boxes[visible].mean(axis=0))
        spread = np.cov(boxes[visible].T)
        covariances.append(spread + np.diag((_PEOPLE_DIFFER * means[-1][[2, 3, 2, 3]]) ** 2))
    return GaussianMixture(
        weights=np.full(len(means), weight),
        means=np.array(means).reshape(-1, 4),
        covariances=np.array(covariances).reshape(-1, 4, 4),
        labels=np.zeros(len(means), dtype=np.int64),
    )


_LEAST = 0.5
"""Least half size for which noise is computed, pixels."""


def box_sigmas(
    boxes: Float[ndarray, "N 4"],
    centre: float,
    size: float,
    *,
    pixels: float = 0.0,
    extents: float | Float[ndarray, " 2"] = 1.0,
    largest: float = np.inf,
) -> Float[ndarray, "N 4"]:
    """Compute the measurement noise of boxes, proportional to their size, plus some pixels.

    With half sizes h in pixels, of the width and the height,

        σ_centre = √((s_c h / e)² + σ_px²),  σ_size = s_h h

    Args:
        boxes: Centre and half sizes of N boxes, pixels.
        centre: s_c, a share of the half size, or metres where ``extents`` are given.
        size: s_h, a share of the half size.
        pixels: σ_px, pixels.
        extents: e, half width and half height of the target, metres; 1 for a share.
        largest: Half height, pixels, above which the noise of a box increases no further.
    """
    half_sizes = np.maximum(boxes[:, 2:], _LEAST)
    half_sizes = half_sizes * np.minimum(1.0, largest / half_sizes[:, 1:])
    centres = np.hypot(centre * half_sizes / extents, pixels)
    return np.concatenate([centres, size * half_sizes], axis=1)
