"""Detection of people in one camera by the shape of head and trunk, without colours.

Possible windows are around heads and trunks of people anywhere in the room; boosted trees classify
each as a person or background; the fusion gets the likelihood ratio and the measurement noise.

[DTPB09] Dollár, Tu, Perona, Belongie, "Integral channel features", BMVC 2009.
[BB05] Bourdev, Brandt, "Robust object detection via soft cascade", CVPR 2005.
[LBS93] Lerro, Bar-Shalom, "Interacting multiple model tracking with target amplitude feature",
IEEE TAES 29(2), 1993.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from jaxtyping import Float, Float32, Int, Int32, UInt8
from numpy import ndarray

from tracker.geometry.camera import Camera
from tracker.kernels.pictures.channels import tree_scores
from tracker.parameters.groups.detections import ShapesParams
from tracker.sequences.pictures.frames import Pictures
from tracker.sequences.sequence import Room, Sequence
from tracker.single_view.box_sizes import box_sigmas, geometry_key, upright_boxes
from tracker.single_view.pictures.foreground import learn_background
from tracker.single_view.shape.channels import Channels, ChannelState
from tracker.steps.table import Table

FILE = Path(__file__).parent / "trees.npz"


@dataclass(frozen=True, slots=True, eq=False)
class Trees:
    """T trees of depth 3 over the means of channels in the cells of a window ([DTPB09]_).

    Their sum is the log odds of a person, with the prior of the training set. A window is
    rejected as soon as the sum is lower than that of nearly any person of the training set
    ([BB05]_).
    """

    features: Int32[ndarray, "T 7"]
    """Feature of each node, breadth first."""
    thresholds: Int32[ndarray, "T 7"]
    """Threshold of each node."""
    leaves: Float32[ndarray, "T 8"]
    """Score of each leaf."""
    least: Float32[ndarray, " T"]
    """Sum after each tree below which a window is rejected."""

    @staticmethod
    @cache
    def read() -> Trees:
        """Read the trees that come with the program."""
        with np.load(FILE) as file:
            return Trees(file["features"], file["thresholds"], file["leaves"], file["least"])

    def write(self, path: Path) -> None:
        """Write the trees to a file."""
        np.savez_compressed(
            path,
            features=self.features,
            thresholds=self.thresholds,
            leaves=self.leaves,
            least=self.least,
        )

    def scores(
        self, sums: Int32[ndarray, "h1 w1 C"], edges: Float[ndarray, "N 4"]
    ) -> Float32[ndarray, " N"]:
        """Compute the log odds of windows; minus infinity for rejected ones.

        Args:
            sums: Integral images of the channels.
            edges: Left, top, right and bottom of N windows, pixels.
        """
        found: Float32[ndarray, " N"] = tree_scores(
            sums, edges, self.features, self.thresholds, self.leaves, self.least
        )
        return found


SPACING = 0.15
"""Distance between the places on the floor, metres."""

MOST_PLACES = 60_000
"""Largest number of places on the floor; in a larger hall their distance is increased."""

CROWNS = (1.05, 1.2, 1.35, 1.5, 1.62, 1.74, 1.86)
"""Heights of the crown above the floor of people who sit, bend and stand, metres."""

WIDTH, ABOVE, BELOW = 1.0, 0.15, 1.1
"""Extent of a window, metres: across, above the crown and below it."""

_SAME_PLACE, _SAME_SIZE = 0.1, 0.16
"""Differences below which windows are merged: shares of their width, and log of their sizes."""

_INSIDE = 0.35
"""Least share of a window that must lie in the image."""


@dataclass(frozen=True, slots=True, eq=False)
class Windows(Table):
    """N windows of an image in which a person may be."""

    edges: Float[ndarray, "N 4"]
    """Left, top, right and bottom, pixels."""
    boxes: Float[ndarray, "N 4"]
    """The target's box in each window: centre and half sizes, pixels."""

    @property
    def sizes(self) -> Float[ndarray, "N 2"]:
        """Pixels per metre, across and down."""
        spans = self.edges[:, 2:] - self.edges[:, :2]
        return np.asarray(spans / [WIDTH, ABOVE + BELOW])

    @staticmethod
    def at(
        camera: Camera,
        crowns: Float[ndarray, "N 3"],
        half_extents: Float[ndarray, " 3"],
        floor: float = -np.inf,
    ) -> tuple[Windows, ndarray]:
        """The windows of people with given crowns, and which of them are visible.

        A target that is a whole body extends down to the floor however low the crown is: the
        centre of a sitting or bent person is at half the height of the crown.

        Args:
            camera: The calibrated camera, upright.
            crowns: Positions of N crowns, world metres.
            half_extents: Half width, depth and height of the target below the crown, metres.
            floor: Height of the floor, world metres.
        """
        middles = crowns - [0.0, 0.0, (BELOW - ABOVE) / 2.0]
        around = np.array([WIDTH / 2.0, WIDTH / 2.0, (ABOVE + BELOW) / 2.0])
        seen, inside = upright_boxes(camera, middles, around)
        extents = np.tile(half_extents.astype(float), (len(crowns), 1))
        extents[:, 2] = np.minimum(extents[:, 2], (crowns[:, 2] - floor) / 2.0)
        targets, whole = upright_boxes(camera, crowns - extents * [0.0, 0.0, 1.0], extents)
        edges = np.concatenate([seen[:, :2] - seen[:, 2:], seen[:, :2] + seen[:, 2:]], axis=1)
        width, height = camera.image_size
        shown = np.clip(edges, -0.5, [width - 0.5, height - 0.5] * 2)
        with np.errstate(invalid="ignore", divide="ignore"):
            spans = shown[:, 2:] - shown[:, :2]
            share = spans.prod(axis=1) / (edges[:, 2:] - edges[:, :2]).prod(axis=1)
        there = np.isfinite(edges).all(axis=1) & np.isfinite(targets).all(axis=1)
        return Windows(edges, targets), there & (inside | whole) & (share > _INSIDE)

    @staticmethod
    def of(camera: Camera, room: Room, half_extents: Float[ndarray, " 3"]) -> Windows:
        """The windows of people of every height anywhere on the floor, without similar ones.

        Args:
            camera: The calibrated camera, upright.
            room: The room, whose lowest height is that of the floor.
            half_extents: Half width, depth and height of the target below the crown, metres.

        Returns:
            None in number where the camera sees no place of the floor.
        """
        across = _places(room.minimum[:2], room.maximum[:2])
        floor = room.minimum[2]
        grid = np.meshgrid(*across, floor + np.array(CROWNS), indexing="ij")
        crowns = np.stack([axis.ravel() for axis in grid], axis=1)
        found, there = Windows.at(camera, crowns, half_extents, float(floor))
        found = found.take(np.flatnonzero(there))
        places = (found.edges[:, :2] + found.edges[:, 2:]) / 2.0
        spans = np.maximum(found.edges[:, 2:] - found.edges[:, :2], 1e-6)
        level = np.round(np.log(spans) / _SAME_SIZE)
        steps = _SAME_PLACE * np.exp(level * _SAME_SIZE)
        alike = np.concatenate([np.round(places / steps), level], axis=1).astype(np.int64)
        first = np.unique(alike, axis=0, return_index=True)[1]
        return found.take(np.sort(first))


def _places(low: Float[ndarray, " 2"], high: Float[ndarray, " 2"]) -> list[Float[ndarray, " K"]]:
    """Places along both sides of the floor, with a limited number together."""
    spacing, lengths = SPACING, high - low
    while np.prod(np.ceil(lengths / spacing)) > MOST_PLACES:
        spacing *= 2.0
    halves = np.minimum(lengths, spacing) / 2.0  # a side shorter than the spacing has one place
    return [
        np.arange(begin + half, end, spacing)
        for begin, end, half in zip(low, high, halves, strict=True)
    ]


def log_ratios(
    log_odds: Float[ndarray, " N"], even: float, weight: float, largest: float
) -> Float[ndarray, " N"]:
    """Convert the log odds of people by shape to log likelihood ratios, min(a ln o/o_0, ln Λ_max).

    Args:
        log_odds: ln o of N people.
        even: ln o_0, at which Λ is 1.
        weight: a, the factor on the log odds.
        largest: ln Λ_max, the upper bound.
    """
    return np.asarray(np.minimum(weight * (log_odds - even), largest))


def shape_sigmas(
    boxes: Float[ndarray, "N 4"], half_extents: Float[ndarray, " 3"], parameters: ShapesParams
) -> Float[ndarray, "N 4"]:
    """Compute the measurement noise of people by shape, constant in metres, plus some pixels.

    Args:
        boxes: Centre and half sizes of N boxes, pixels.
        half_extents: Half width, depth and height of the target, metres.
        parameters: The standard deviations in metres, pixels and shares of the size.
    """
    p = parameters
    extents = np.array([(half_extents[0] + half_extents[1]) / 2.0, half_extents[2]])
    return box_sigmas(boxes, p.place_sigma, p.size_sigma, pixels=p.pixel_sigma, extents=extents)


PIXELS_PER_METRE = 48.0
"""Resolution to which images are reduced, at people in the middle of the room: that of the training
set. Images of lower resolution are not changed."""

SAME_PERSON = np.array([0.35, 0.5])
"""Distance across and down within which two places in an image are of one person, metres."""

_NEAR = 2.0
"""Log odds below the best of a person's windows at which others do not contribute to the place."""


@dataclass(frozen=True, slots=True, eq=False)
class Shapes:
    """N people that were detected in one image."""

    boxes: Float[ndarray, "N 4"]
    """Boxes of the target: centre and half sizes, pixels."""
    log_odds: Float[ndarray, " N"]
    """Log odds of a person in each box."""
    sizes: Float[ndarray, "N 2"]
    """Pixels per metre at each box, across and down."""
    unlikely: Float[ndarray, "U 4"]
    """Boxes with log odds below the threshold."""
    windows: Windows
    """The W windows that were not rejected."""
    odds: Float[ndarray, " W"]
    """Log odds of a person in each of these windows."""

    def support(self, boxes: Float[ndarray, "M 4"]) -> Float[ndarray, " M"]:
        """Log odds of a person in each of M boxes: those of the best window there, -inf for none.

        Args:
            boxes: Centre and half sizes of the target's boxes, pixels.
        """
        apart = np.abs(boxes[:, None, :2] - self.windows.boxes[None, :, :2])
        there = (apart < SAME_PERSON * self.windows.sizes).all(axis=2)
        return np.asarray(np.where(there, self.odds, -np.inf).max(axis=1, initial=-np.inf))


class ShapeFinder:
    """A sliding-window detector in an upright camera, with non-maximum suppression."""

    def __init__(self, sequence: Sequence, camera_index: int, reader: Pictures) -> None:
        """Learn the background of one camera."""
        camera = sequence.cameras[camera_index]
        background = learn_background(sequence, camera_index, reader)
        self._windows = Windows.of(camera, sequence.room, sequence.target_half_extents)
        self._channels: Channels | None = None
        if background is None or not len(self._windows.edges):
            return
        size = float(np.median(self._windows.sizes))
        factor = min(1.0, PIXELS_PER_METRE / size)
        self._channels = Channels(background, factor, size * factor, sequence.step_time)
        across, down = self._channels.factors
        self._edges = (self._windows.edges + 0.5) * [across, down, across, down] - 0.5
        self._trees = Trees.read()

    @staticmethod
    def of(sequence: Sequence, camera_index: int, reader: Pictures) -> ShapeFinder:
        """The detector of a camera, created once, since it has no state."""
        return reader.once(
            (
                "shape finder",
                camera_index,
                sequence.step_time,
                geometry_key(sequence, camera_index),
            ),
            lambda: ShapeFinder(sequence, camera_index, reader),
        )

    def start(self) -> ChannelState | None:
        """The state before the first image."""
        return None if self._channels is None else self._channels.initial()

    def watch(
        self, state: ChannelState | None, picture: UInt8[ndarray, "h w 3"]
    ) -> ChannelState | None:
        """Update the state by an image without detecting people in it.

        Args:
            state: The state after the image before.
            picture: The image, BGR.
        """
        if self._channels is None or state is None:
            return state
        return self._channels.watch(state, picture)

    def find(
        self,
        state: ChannelState | None,
        picture: UInt8[ndarray, "h w 3"],
        least: float,
        overlap: float,
    ) -> tuple[ChannelState | None, Shapes]:
        """Detect the people of one image.

        Args:
            state: The state after the image before.
            picture: The image, BGR.
            least: Log odds from which a person is detected.
            overlap: Intersection over union above which windows are of one person, 0 … 1.
        """
        if self._channels is None or state is None:
            none = np.zeros((0, 4))
            nowhere = Windows(none, none)
            return state, Shapes(none, np.zeros(0), none[:, :2], none, nowhere, np.zeros(0))
        state, sums = self._channels.step(state, picture)
        scores = self._trees.scores(sums, self._edges).astype(float)
        ended = np.flatnonzero(np.isfinite(scores))
        windows, scores = self._windows.take(ended), scores[ended]
        owners, best = strongest(windows.edges, scores, overlap)
        likely = best[scores[best] >= least]
        boxes = windows.boxes[likely].copy()
        for n, i in enumerate(likely):
            own = np.flatnonzero((owners == i) & (scores > scores[i] - _NEAR))
            weights = np.exp(scores[own] - scores[i])
            boxes[n] = weights @ windows.boxes[own] / weights.sum()
        unlikely = windows.boxes[best[scores[best] < least]]
        return state, Shapes(
            boxes, scores[likely], windows.sizes[likely], unlikely, windows, scores
        )


def strongest(
    edges: Float[ndarray, "N 4"], scores: Float[ndarray, " N"], overlap: float
) -> tuple[Int[ndarray, " N"], Int[ndarray, " K"]]:
    """Select windows by greedy non-maximum suppression, the best first.

    Unlike OpenCV's ``NMSBoxes`` it also says which window each of the suppressed ones belongs to.

    Args:
        edges: Left, top, right and bottom of N windows, pixels.
        scores: Score of each window.
        overlap: Intersection over union from which the weaker window is suppressed, 0 … 1.

    Returns:
        Index of the selected window that each belongs to, and the indices of the selected ones.
    """
    areas = (edges[:, 2] - edges[:, 0]) * (edges[:, 3] - edges[:, 1])
    owners = np.full(len(edges), -1)
    best: list[int] = []
    for i in np.argsort(-scores, kind="stable").tolist():
        if owners[i] >= 0:
            continue
        free = np.flatnonzero(owners < 0)
        low = np.maximum(edges[free, :2], edges[i, :2])
        high = np.minimum(edges[free, 2:], edges[i, 2:])
        shared = np.maximum(high - low, 0.0).prod(axis=1)
        owners[free[shared >= overlap * (areas[free] + areas[i] - shared)]] = i
        owners[i] = i
        best.append(i)
    return owners, np.array(best, dtype=np.int64)
