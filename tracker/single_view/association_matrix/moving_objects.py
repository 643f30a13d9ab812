"""Foreground components and the tracks in each, as immutable values.

[CMQ07] Chang, Ma, Qiao, "Human oriented multi-target tracking algorithm in video
sequence", Control and Decision 22(4), 2007.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

_LONGEST_PREDICTION = 3
"""Number of steps for which an interrupted object is predicted to move on; then it is sought where
it would be, in a circle that grows (``straying``)."""


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """The track of a person, with the appearance when last alone in a foreground component."""

    label: int
    """Id of the track."""
    box: Float[ndarray, " 4"]
    """Present box, that of the object or of the mean shift: centre and half sizes, pixels."""
    area: float
    """Smoothed area of the object while the track was alone in it, square pixels."""
    histogram: Float[ndarray, " bins"]
    """Smoothed colour histogram of the object while the track was alone in it, with sum 1."""
    age: int = 1
    """Number of steps alone in an object."""


@dataclass(frozen=True, slots=True, eq=False)
class MovingObject:
    """A foreground component and its tracks."""

    labels: tuple[int, ...]
    """Labels of the object's tracks, ascending; several where people merged."""
    box: Float[ndarray, " 4"]
    """Centre and half sizes of the component's box, pixels."""
    area: int
    """Number of pixels of the component."""
    velocity: Float[ndarray, " 2"]
    """Displacement of the centre, pixels per step: the mean of the last one and of this number a
    step before."""
    missing: int = 0
    """Number of steps since the object was interrupted."""
    followed: bool = False
    """Whether the two tracks of the object are tracked separately by mean shift."""

    @property
    def size(self) -> float:
        """The root of half width times half height, pixels."""
        return float(np.sqrt(np.prod(self.box[2:])))

    @property
    def expected(self) -> Float[ndarray, " 2"]:
        """The predicted centre one step later, pixels."""
        steps = 1 + min(self.missing, _LONGEST_PREDICTION)
        return np.asarray(self.box[:2] + self.velocity * steps)


@dataclass(frozen=True, slots=True, eq=False)
class Situation:
    """Objects and tracks after a step."""

    tracks: dict[int, Track]
    """Tracks by label; never changed in place."""
    objects: tuple[MovingObject, ...]
    """Objects in the order of the step's components."""
    lost: tuple[MovingObject, ...]
    """Objects that are interrupted and have not ended."""
    owners: Int[ndarray, "h w"] | None
    """Object of each pixel, -1 for none; None before the first image."""
    next_label: int
    """The first label that is free."""

    @staticmethod
    def start() -> Situation:
        """The situation without objects."""
        return Situation({}, (), (), None, 1)
