"""What the smoothing says: tracks over the whole recording, and what it decided and why."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.smoothing.calibration import Calibration

DecisionKind = Literal["cut", "joined", "removed"]


@dataclass(frozen=True, slots=True)
class Decision:
    """One thing that the smoothing made otherwise than the filter, and with what odds."""

    kind: DecisionKind
    step: int
    """Where: the first step after a cut or a join; the first step of what was removed."""
    label: int
    """Of the track that it happened to; of a removed one the filter's."""
    other: int
    """The filter's label of what was cut off or joined; that of a removed one again."""
    probability: float
    """Of what was decided."""
    against: float
    """Of the best alternative."""
    reason: str
    """In a few words."""


@dataclass(frozen=True, slots=True, eq=False)
class Joined:
    """The pieces that tracks were joined of, and the odds of joining them otherwise."""

    labels: Int[ndarray, " n"]
    """Of the track that each piece is in, -1 for nobody's."""
    firsts: Int[ndarray, " n"]
    lasts: Int[ndarray, " n"]
    begins: Float[ndarray, "n 3"]
    """World metres."""
    ends: Float[ndarray, "n 3"]
    worths: Float[ndarray, " n"]
    """Log odds of each piece's boxes against clutter."""
    births: Float[ndarray, " n"]
    """Log probability of beginning there."""
    deaths: Float[ndarray, " n"]
    earlier: Int[ndarray, " P"]
    """Of each possible pair."""
    later: Int[ndarray, " P"]
    gains: Float[ndarray, " P"]
    """Log odds of being one person's."""


@dataclass(frozen=True, slots=True, eq=False)
class Smoothed:
    """Tracks of the whole recording, one row a person a step, by step and then label."""

    frames: Int[ndarray, " N"]
    labels: Int[ndarray, " N"]
    """The filter's where a track goes on one of its; larger ones for people it did not part."""
    means: Float[ndarray, "N d"]
    """Position in metres, world frame; then velocity, where the motion model has one."""
    covariances: Float[ndarray, "N d d"]
    existences: Float[ndarray, " N"]
    """Probability that the person was there, by the boxes of all steps."""
    seen: Bool[ndarray, "N C"]
    """Whether a box of each camera is the person's with more than even odds."""
    decisions: tuple[Decision, ...] = ()
    learnt: Calibration = field(default_factory=lambda: Calibration.none(0, 0, 3))
    """What the recording said of its boxes; the sizes are of the final tracks."""
    joined: Joined | None = None
    """Of what tracks were joined, where that was settled."""

    @staticmethod
    def empty(dimension: int, cameras: int) -> Smoothed:
        """Nobody."""
        return Smoothed(
            np.zeros(0, dtype=np.int64),
            np.zeros(0, dtype=np.int64),
            np.zeros((0, dimension)),
            np.zeros((0, dimension, dimension)),
            np.zeros(0),
            np.zeros((0, cameras), dtype=bool),
        )
