"""Possible windows in an image: around heads and trunks of people anywhere in the room."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.geometry.camera import Camera
from tracker.sequences.sequence import Room
from tracker.single_view.box_sizes import upright_boxes

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
class Windows:
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

    def take(self, indices: ndarray) -> Windows:
        """Select some of the windows, by index."""
        return Windows(self.edges[indices], self.boxes[indices])

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
