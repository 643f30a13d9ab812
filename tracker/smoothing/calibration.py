"""What a recording says of its own boxes: people's sizes, each camera's offset and noise."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from tracker.fusion.target_model import ExpectedBoxes
from tracker.kernels.gating import Measurements

_BOX_SIGMA = 0.1
"""Of one box's edge about a person's, in half heights."""

_ALIKE = 20.0
"""Boxes of neighbouring steps and cameras err alike: so many count as one."""

_SIZE_SIGMA = 0.1
"""How far people's heights differ from the target's, as a share of it."""

_OFFSET_SIGMA = 0.03
"""How far a camera's boxes may lie off as a whole, in half heights."""

SIZE_RIDGE = _ALIKE * (_BOX_SIGMA / _SIZE_SIGMA) ** 2
"""As many boxes as the prior of a person's size is worth."""

OFFSET_RIDGE = _ALIKE * (_BOX_SIGMA / _OFFSET_SIGMA) ** 2
"""As many boxes as the prior of a camera's offset is worth."""

NARROWEST, WIDEST = 0.15, 1.0
"""Between these factors of the stated noise the learnt one lies."""

ODD = 0.4
"""Half heights: who is so far off is not standing."""

FEWEST = 50
"""Boxes of a camera below which its noise is taken as stated."""


@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """n people's sizes and the offsets and noises of C cameras, for measurements of m numbers.

    A box of person i in camera c is taken as

        z = h_c(x) + ½ height(h_c(x)) (b_c + s_i u + d_i w) + v,   v ~ N(0, f_c² R)

    with u = (0, −1, 1) and w = (0, 1, 1) for horizontal centre, top and bottom: who is taller than
    the target has a taller box, without being nearer, and whose boxes lie low is not lower.
    """

    sizes: Float[ndarray, " n"]
    """s: height beyond the target's, as a share of it."""
    offsets: Float[ndarray, "C m"]
    """b, in half heights."""
    noises: Float[ndarray, " C"]
    """f."""
    shifts: Float[ndarray, " n"]
    """d: how far below the person's middle the boxes lie, in half heights."""

    @staticmethod
    def none(people: int, cameras: int, size: int) -> Calibration:
        """As stated: nothing learnt."""
        return Calibration(
            np.zeros(people), np.zeros((cameras, size)), np.ones(cameras), np.zeros(people)
        )

    def of_people(self, people: ndarray) -> Calibration:
        """Of some of the people, in that order."""
        return replace(self, sizes=self.sizes[people], shifts=self.shifts[people])

    def measured(self, camera: int, measurements: Measurements) -> Measurements:
        """A camera's measurements with the noise that was learnt."""
        return measurements._replace(noises=self.noises[camera] ** 2 * measurements.noises)

    def shift(self, camera: int, people: ndarray, expected: ExpectedBoxes) -> Float[ndarray, "L m"]:
        """What is added to the expected measurements of some boxes, pixels.

        A number that the picture's edge holds fast stays.
        """
        half_height = (expected.boxes[:, 3] - expected.boxes[:, 1]) / 2.0
        size = self.offsets.shape[1]
        shares = self.offsets[camera] + self.sizes[people, None] * upright(size)
        shares += self.shifts[people, None] * lower(size)
        return np.asarray(half_height[:, None] * shares * free(expected))


def free(expected: ExpectedBoxes) -> Bool[ndarray, "L m"]:
    """Which numbers of some boxes move with the person: not those at the picture's edge."""
    moves = expected.jacobians != 0.0
    return np.asarray(moves[:, :, 0] | moves[:, :, 1] | moves[:, :, 2])


def upright(size: int) -> Float[ndarray, " m"]:
    """u: how a taller person's box differs."""
    return {
        2: np.zeros(2),
        3: np.array([0.0, -1.0, 1.0]),
        4: np.array([0.0, -1.0, 1.0, 0.0]),
    }[size]


def lower(size: int) -> Float[ndarray, " m"]:
    """w: how a box that lies lower differs."""
    return {
        2: np.array([0.0, 1.0]),
        3: np.array([0.0, 1.0, 1.0]),
        4: np.array([0.0, 1.0, 1.0, 0.0]),
    }[size]
