"""Boxes in an image, and the conversion between three forms of coordinates.

Arrays of boxes that are passed around are rows of ``centre_x, centre_y, half_width,
half_height`` in pixels, unless their docstring names another form.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Boxes:
    """Axis-parallel boxes, pixels, with any number of leading axes."""

    centred: Float[ndarray, "*N 4"]
    """Centre x, centre y, half width, half height."""

    def __post_init__(self) -> None:
        if self.centred.shape[-1:] != (4,):
            raise ValueError(
                f"boxes: expected four numbers each, got an array of shape {self.centred.shape}"
            )

    @staticmethod
    def from_left_top(boxes: Float[ndarray, "*N 4"]) -> Boxes:
        """Make boxes from rows of ``left, top, width, height``."""
        half_sizes = boxes[..., 2:] / 2.0
        return Boxes(np.concatenate([boxes[..., :2] + half_sizes, half_sizes], axis=-1))

    @staticmethod
    def from_corners(low: Float[ndarray, "*N 2"], high: Float[ndarray, "*N 2"]) -> Boxes:
        """Make boxes from rows of ``left, top`` and of ``right, bottom``."""
        return Boxes(np.concatenate([low + high, high - low], axis=-1) / 2.0)

    @property
    def centres(self) -> Float[ndarray, "*N 2"]:
        """Centre x, centre y."""
        return self.centred[..., :2]

    @property
    def half_sizes(self) -> Float[ndarray, "*N 2"]:
        """Half width, half height."""
        return self.centred[..., 2:]

    @property
    def low(self) -> Float[ndarray, "*N 2"]:
        """Left, top."""
        return np.asarray(self.centres - self.half_sizes)

    @property
    def high(self) -> Float[ndarray, "*N 2"]:
        """Right, bottom."""
        return np.asarray(self.centres + self.half_sizes)

    @property
    def corners(self) -> Float[ndarray, "*N 4"]:
        """``left, top, right, bottom``."""
        return np.concatenate([self.low, self.high], axis=-1)

    @property
    def left_top(self) -> Float[ndarray, "*N 4"]:
        """``left, top, width, height``."""
        return np.concatenate([self.low, 2.0 * self.half_sizes], axis=-1)


def box_overlaps(
    first: Float[ndarray, "M 4"], second: Float[ndarray, "N 4"]
) -> Float[ndarray, "M N"]:
    """Compute the intersection over union of every box of one set with every box of the other.

    It is 0 for boxes without area.

    Args:
        first: left, top, width, height of M boxes, pixels.
        second: left, top, width, height of N boxes, pixels.
    """
    return paired_overlaps(first[:, None], second[None])


def paired_overlaps(
    first: Float[ndarray, "*#N 4"], second: Float[ndarray, "*#N 4"]
) -> Float[ndarray, "*N"]:
    """Compute the intersection over union of each box with the one at the same index.

    Args:
        first: left, top, width, height, pixels.
        second: left, top, width, height, pixels.
    """
    low = np.maximum(first[..., :2], second[..., :2])
    high = np.minimum(first[..., :2] + first[..., 2:], second[..., :2] + second[..., 2:])
    shared = np.maximum(high - low, 0.0).prod(axis=-1)
    areas = first[..., 2:].prod(axis=-1) + second[..., 2:].prod(axis=-1)
    return np.asarray(shared / np.maximum(areas - shared, np.finfo(float).tiny))
