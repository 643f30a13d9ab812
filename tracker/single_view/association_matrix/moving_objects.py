"""Pieces of foreground and the tracks that each of them carries, as values.

[CMQ07] Chang, Ma, Qiao, "Human oriented multi-target tracking algorithm in video
sequence", Control and Decision 22(4), 2007.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """Somebody, as he was when he was last alone in his piece of foreground."""

    label: int
    box: Float[ndarray, " 4"]
    """Where he is now: his object, or what the mean shift found; centre and half sizes, pixels."""
    area: float
    """Pixels, when alone."""
    histogram: Float[ndarray, " bins"]
    """Colours, when alone."""
    age: int = 1
    """For how many steps he was alone in an object."""


@dataclass(frozen=True, slots=True, eq=False)
class MovingObject:
    """A piece of foreground and whom it shows."""

    labels: tuple[int, ...]
    """Its tracks, ascending; several where people merged."""
    box: Float[ndarray, " 4"]
    area: int
    velocity: Float[ndarray, " 2"]
    """Pixels a step."""
    missing: int = 0
    """For how many steps it has been gone."""
    followed: bool = False
    """Whether its two tracks are followed apart."""

    @property
    def size(self) -> float:
        """The root of half width times half height, pixels."""
        return float(np.sqrt(np.prod(self.box[2:])))

    @property
    def expected(self) -> Float[ndarray, " 2"]:
        """Where it should be one step later."""
        return np.asarray(self.box[:2] + self.velocity * (1 + min(self.missing, 3)))


@dataclass(frozen=True, slots=True, eq=False)
class Situation:
    """What one step leaves to the next."""

    tracks: dict[int, Track]
    """By label; never changed in place."""
    objects: tuple[MovingObject, ...]
    """In the order of the step's blobs."""
    lost: tuple[MovingObject, ...]
    """Interrupted and not yet ended."""
    owners: Int[ndarray, "h w"] | None
    """The object that each pixel is of, -1 for none; None before the first picture."""
    next_label: int

    @staticmethod
    def start() -> Situation:
        """Nobody is there."""
        return Situation({}, (), (), None, 1)
