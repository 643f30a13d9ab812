"""The result of smoothing: tracks over the whole recording, and the decisions about identities."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.smoothing.calibration import Calibration
from tracker.smoothing.camera_errors import CameraErrors
from tracker.smoothing.noise import NoiseModel

DecisionKind = Literal["cut", "joined", "removed"]


@dataclass(frozen=True, slots=True)
class Decision:
    """One difference between the smoothed tracks and the filter's, with its probability."""

    kind: DecisionKind
    """Whether a track was split, linked or removed."""
    step: int
    """The first step after a split or link; the first step of a removed track."""
    label: int
    """Label of the track; the filter's for a removed one."""
    other: int
    """The filter's label of the part that was split off or linked; for a removed track the same."""
    probability: float
    """Probability of the decision, 0 … 1."""
    against: float
    """Probability of the best alternative, 0 … 1."""
    reason: str
    """Reason in a few words."""


@dataclass(frozen=True, slots=True, eq=False)
class LinkedTracklets:
    """The n tracklets that tracks consist of, and the log odds of P possible links."""

    labels: Int[ndarray, " n"]
    """Label of the track that each tracklet is in, -1 for a false one."""
    firsts: Int[ndarray, " n"]
    """First step of each tracklet."""
    lasts: Int[ndarray, " n"]
    """Last step of each tracklet."""
    begins: Float[ndarray, "n 3"]
    """Position at the first step, world metres."""
    ends: Float[ndarray, "n 3"]
    """Position at the last step, world metres."""
    worths: Float[ndarray, " n"]
    """Log odds of each tracklet's boxes against clutter."""
    births: Float[ndarray, " n"]
    """Log probability of a track beginning with the tracklet."""
    deaths: Float[ndarray, " n"]
    """Log probability of a track ending with the tracklet."""
    earlier: Int[ndarray, " P"]
    """Index of the first tracklet of each possible pair."""
    later: Int[ndarray, " P"]
    """Index of the second tracklet of each pair."""
    gains: Float[ndarray, " P"]
    """Log odds of the pair being of one person."""


@dataclass(frozen=True, slots=True, eq=False)
class Smoothed:
    """Tracks of the whole recording: N rows, one for each track at each step, by step and label."""

    frames: Int[ndarray, " N"]
    """Step of each row."""
    labels: Int[ndarray, " N"]
    """Label of the track: the filter's where it continues one of its tracks, else a larger one."""
    means: Float[ndarray, "N d"]
    """Position in metres, world frame; then velocity, where the motion model has one."""
    covariances: Float[ndarray, "N d d"]
    """Covariance of each state, metres and seconds."""
    existences: Float[ndarray, " N"]
    """Existence probability given the boxes of all steps."""
    seen: Bool[ndarray, "N C"]
    """Whether the association probability with a box of each camera is above 0.5."""
    decisions: tuple[Decision, ...] = ()
    """Differences from the filter's tracks, by step."""
    learnt: Calibration = field(default_factory=lambda: Calibration.none(0, 0, 3))
    """The self-calibration of the boxes; its sizes are those of the final tracks."""
    joined: LinkedTracklets | None = None
    """The tracklets of the tracks, where identities were resolved."""
    noise: NoiseModel | None = None
    """The noise of the boxes, of which the covariances follow; None where it is not estimated."""
    common: float = 0.0
    """Part of the covariances along x and y: of errors that all cameras have in common, m²."""
    heights: Float[ndarray, " N"] = field(default_factory=lambda: np.zeros(0))
    """Height of the track's person while standing, metres; NaN where it is not estimated."""
    sigma_heights: Float[ndarray, " N"] = field(default_factory=lambda: np.zeros(0))
    """Standard deviation of the height, metres."""
    cameras: CameraErrors | None = None
    """The errors and delays of each camera; None where no noise is estimated."""

    @staticmethod
    def empty(dimension: int, cameras: int) -> Smoothed:
        """The result without tracks.

        Args:
            dimension: d, the size of the state.
            cameras: C, the number of cameras.
        """
        return Smoothed(
            np.zeros(0, dtype=np.int64),
            np.zeros(0, dtype=np.int64),
            np.zeros((0, dimension)),
            np.zeros((0, dimension, dimension)),
            np.zeros(0),
            np.zeros((0, cameras), dtype=bool),
        )
