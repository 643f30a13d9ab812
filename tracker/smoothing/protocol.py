"""The interface of every smoothing method: from all steps of the filter to smoothed tracks.

A result has tracks over the whole recording and the decisions about identities; it is converted to
the reported trajectories of a run.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence as Many
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.corrections import Correction
from tracker.fusion.protocol import FusionResult
from tracker.fusion.trajectories import Bounds, Trajectories
from tracker.kernels.mixtures import nearest_components
from tracker.parameters.catalogue import RunParameters
from tracker.sequences.sequence import Sequence
from tracker.single_view.protocol import ViewResult
from tracker.smoothing.calibration import Calibration
from tracker.smoothing.camera_errors import CameraErrors
from tracker.smoothing.noise import NoiseModel
from tracker.steps import Steps

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


class ResultStore(Protocol):
    """Intermediate results of runs that differ from this one only in corrections of identity.

    A stored result is never changed, and equals bit for bit that of computing it again.
    """

    def get(self, what: str) -> Any:
        """Return the result stored under a name, None if there is none."""
        ...

    def put(self, what: str, found: object) -> None:
        """Store a result under a name for later runs."""
        ...


class EmptyStore:
    """A store that is always empty."""

    def get(self, what: str) -> Any:
        """Return None, since no result is stored."""
        return None

    def put(self, what: str, found: object) -> None:
        """Discard the result."""


class SmoothingMethod(Protocol):
    """A smoothing method, prepared for one sequence."""

    def smooth(
        self,
        views: Many[tuple[ViewResult, ...]],
        fused: Many[FusionResult],
        check: Callable[[], None] = lambda: None,
        corrections: Many[Correction] = (),
        earlier: ResultStore | None = None,
    ) -> Smoothed | None:
        """Estimate the tracks of some steps from step 0 on, each from the boxes of all steps.

        Args:
            views: The results of stage 1 for each step.
            fused: The result of stage 2 for each step.
            check: A function that is called repeatedly, and raises an exception to stop the work.
            corrections: The user's corrections; passed only if there are any.
            earlier: The store of intermediate results of runs with the same boxes, tracks of the
                filter and constraints of places; passed only to methods that have this argument.

        Returns:
            The tracks; None where those of the filter do not change.
        """
        ...


class NoSmoothing:
    """No smoothing: the filter's tracks, as a live system would have them."""

    def __init__(self, sequence: Sequence, parameters: RunParameters) -> None:
        """The method needs no preparation."""

    def smooth(
        self,
        views: Many[tuple[ViewResult, ...]],
        fused: Many[FusionResult],
        check: Callable[[], None] = lambda: None,
        corrections: Many[Correction] = (),
        earlier: ResultStore | None = None,
    ) -> None:
        """Return None: the filter's tracks do not change."""


_FAINT = 0.05
"""Weight below which a component belongs to no track. From 0.02 to 0.2 nothing changes in random
crowds and recordings."""


def tracks_of(
    smoothed: Smoothed,
    fused: Many[FusionResult],
    ids: dict[int, int],
    *,
    extraction_threshold: float,
    bounds: Bounds,
    near: float,
) -> Trajectories:
    """Extract the tracks whose existence is above the threshold, inside the room.

    Args:
        smoothed: The smoothed tracks of all steps.
        fused: The result of stage 2 for each step, for the component of each track.
        ids: The id of each label that the filter reported; other labels get the next numbers.
        extraction_threshold: Existence probability above which a row is reported.
        bounds: The volume in which tracks are reported.
        near: Distance within which a component of the filter's posterior is the track's, metres.
    """
    chosen = smoothed.existences > extraction_threshold
    chosen &= bounds.contain(smoothed.means[:, :3])
    rows = np.flatnonzero(chosen)
    known = dict(ids)
    for label in dict.fromkeys(smoothed.labels[rows].tolist()):
        if label not in known:
            known[label] = max(known.values(), default=0) + 1
    numbers = np.array([known[label] for label in smoothed.labels[rows].tolist()], dtype=np.int64)
    rows = rows[np.lexsort((numbers, smoothed.frames[rows]))]
    numbers = np.array([known[label] for label in smoothed.labels[rows].tolist()], dtype=np.int64)
    components, labels = _components(smoothed, rows, fused, near)
    covariances = smoothed.covariances[rows]
    return Trajectories(
        frames=smoothed.frames[rows],
        ids=numbers,
        positions=smoothed.means[rows, :3],
        existences=smoothed.existences[rows],
        sigmas=np.sqrt(np.diagonal(covariances, axis1=1, axis2=2)[:, :3]),
        seen=smoothed.seen[rows],
        components=components,
        labels=labels,
        covariances_xy=covariances[:, 0, 1],
        heights=smoothed.heights[rows],
        sigma_heights=smoothed.sigma_heights[rows],
    )


def names_of(smoothed: Smoothed, tracks: Trajectories) -> dict[int, int]:
    """The id of each label that is reported, for the tracks that were made from ``smoothed``.

    Args:
        smoothed: The result of stage 3 of a run.
        tracks: The result of :func:`tracks_of`; while the run continues they may be others.
    """
    place = {
        (frame, *mean): label
        for frame, mean, label in zip(
            smoothed.frames.tolist(),
            smoothed.means[:, :3].tolist(),
            smoothed.labels.tolist(),
            strict=True,
        )
    }
    ids, rows = np.unique(tracks.ids, return_index=True)
    found = (place.get((int(tracks.frames[row]), *tracks.positions[row].tolist())) for row in rows)
    return {label: int(name) for name, label in zip(ids, found, strict=True) if label is not None}


def _components(
    smoothed: Smoothed, rows: Int[ndarray, " R"], fused: Many[FusionResult], near: float
) -> tuple[Int[ndarray, " R"], Int[ndarray, " R"]]:
    """Find each row's nearest component of its step's posterior, and its label; -1 for none."""
    labels = np.full(len(rows), -1, dtype=np.int64)
    column = Steps.of(fused, FusionResult).column
    weights, means = column("posterior.weights"), column("posterior.means")
    if not len(weights.values):
        return labels, labels.copy()
    frames = smoothed.frames[rows]
    components = nearest_components(
        np.ascontiguousarray(smoothed.means[rows, :3]),
        np.searchsorted(frames, np.arange(len(weights) + 1)),
        weights.values,
        means.values,
        weights.starts,
        _FAINT,
        near,
    )
    own, of_component = components >= 0, column("posterior.labels")
    labels[own] = of_component.values[of_component.starts[frames[own]] + components[own]]
    return components, labels
