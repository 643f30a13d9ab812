"""A run: the results of its stages, its cache keys, and its progress."""

from __future__ import annotations

import copy
import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.corrections.kinds import IN_THE_FUSION, OF_PEOPLE, Correction, Kind, digest
from tracker.corrections.outcomes import Outcome, names_by_track, supporting_corrections
from tracker.fusion.protocol import FusionResult
from tracker.fusion.trajectories import Trajectories
from tracker.parameters import Stage
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.values import CHOSEN_BY, stage_values
from tracker.runs.numbers_version import method_version, numbers_version
from tracker.sequences.sequence import Sequence
from tracker.single_view.protocol import ViewResult
from tracker.smoothing import Smoothed
from tracker.steps import Steps


class Cancelled(Exception):
    """The run was superseded or stopped; the steps that were computed remain usable."""


@dataclass(frozen=True, slots=True)
class Progress:
    """The progress of a run."""

    stage: Stage
    """The stage under way: the first that had to be computed, which takes most of the time, until
    all steps are fused; then the one that is left, smoothing or tracks."""
    done: int
    """The number of steps whose tracks are ready, from step 0 on."""
    total: int
    """The number of steps that the run computes."""
    seconds: float
    """Time since the run began, seconds."""
    fresh: int
    """The number of steps that this run computed itself, rather than re-used from an earlier
    one."""
    preparing: float = 0.0
    """Time until the first of these steps was ready, seconds: the background is learnt, and kernels
    are loaded."""

    @property
    def steps_per_second(self) -> float:
        """Mean speed so far, without the preparation before the first step."""
        if self.fresh > 1 and self.seconds > self.preparing:
            return (self.fresh - 1) / (self.seconds - self.preparing)
        return self.fresh / self.seconds if self.seconds > 0.0 else 0.0

    @property
    def seconds_left(self) -> float | None:
        """Remaining time by the mean speed, seconds; None before the first step."""
        return (self.total - self.done) / self.steps_per_second if self.fresh else None


@dataclass(eq=False)
class Run:
    """One run: the results (columns) of its stages, filled step by step from step 0.

    One thread appends; any thread may read the steps below :attr:`done`.
    """

    sequence: Sequence
    """The recording."""
    parameters: RunParameters
    """The chosen methods and all parameters."""
    seed: int
    """The seed of the random numbers."""
    keys: dict[Stage, str]
    """The cache key of each stage whose results the run has."""
    stored_probabilities: Float[ndarray, "N C"] | None = None
    """The detection probability of each row of :attr:`tracks` in each camera, for a run from the
    library: it has these and the tracks, and no results of the stages. None for other runs."""
    stored_names: Mapping[int, str] = field(default_factory=dict)
    """The names of tracks, by id, for a run from the library; empty for other runs."""
    views: Steps[tuple[ViewResult, ...]] = field(init=False)
    """The results of stage 1 of each step, one for each camera."""
    fused: Steps[FusionResult] = field(init=False)
    """The result of stage 2 of each step."""
    tracks: Trajectories = field(init=False)
    """The tracks of the steps below :attr:`done`: those of the filter while it runs, then the
    smoothed ones once :attr:`smoothed` is computed."""
    filtered: Trajectories = field(init=False)
    """The tracks of the filter alone, as a live system would report them."""
    smoothed: Smoothed | None = None
    """The result of stage 3 for all requested steps; None before, or if it is switched off."""
    done: int = 0
    """The number of steps that have tracks, filtered or smoothed."""
    view_states: tuple[Any, ...] | None = None
    """The state of stage 1 of each camera after the last step of :attr:`views`; None if that is
    the last of the sequence."""
    from_pictures: bool = False
    """Whether stage 1 decoded pictures."""
    fusion_state: Any = None
    """The state of stage 2 after the last step of :attr:`fused`."""
    corrections: tuple[Correction, ...] = ()
    """The user's corrections, which the run applies."""
    outcomes: tuple[Outcome, ...] = ()
    """The outcome of each correction, once all steps are computed."""
    corrected: bool = False
    """Whether :attr:`tracks` are those with the corrections applied."""
    finished: bool = False
    """Whether every stage has processed all steps of the sequence, so that :attr:`tracks` are
    final and figures computed from them are the run's."""

    def __post_init__(self) -> None:
        self.views = Steps(ViewResult, len(self.sequence.views))
        self.fused = Steps(FusionResult)
        self.tracks = self.filtered = Trajectories.empty(len(self.sequence.views))

    @property
    def key(self) -> str:
        """The hash of the sequence, all parameters, the seed and the code."""
        return self.keys["tracks"]

    @property
    def revision(self) -> int:
        """The number of times that the tracks of all steps were replaced. The run's key and this
        number identify the tracks of a step.

        It is 0 while they are the filter's; 1 once they are smoothed, or corrected where nothing
        is smoothed; 2 once they are smoothed and corrected.
        """
        return (self.tracks is not self.filtered) + (self.corrected and bool(self.corrections))

    @property
    def only_tracks(self) -> bool:
        """Whether the run is from the library: it has tracks, and no results of the stages."""
        return self.stored_probabilities is not None

    def detection_probabilities(self, rows: Int[ndarray, " K"]) -> Float[ndarray, "K C"]:
        """Return the detection probability of rows of the tracks in each camera; NaN for rows that
        the filter had no component for, since smoothing filled a gap with them."""
        if self.stored_probabilities is not None:
            return np.asarray(self.stored_probabilities[rows])
        found = np.full((len(rows), len(self.sequence.views)), np.nan)
        steps, components = self.tracks.frames[rows], self.tracks.components[rows]
        own = np.flatnonzero((components >= 0) & (steps < len(self.fused)))
        if len(own):
            found[own] = self.fused.take("detection_probabilities", steps[own], components[own])
        return found

    @property
    def complete(self) -> bool:
        """Whether all steps of the sequence have tracks."""
        return self.done == self.sequence.frames

    def snapshot(self) -> Run:
        """Return a shallow copy whose tracks do not change, for readers in other threads: the
        thread that computes the run may replace the tracks at any time."""
        return copy.copy(self)


_APPLIED_BY: dict[Stage, tuple[Kind, ...]] = {
    "fusion": IN_THE_FUSION, "smoothing": OF_PEOPLE,
}  # fmt: skip
"""The kinds of corrections that a stage applies."""


def row_corrections(run: Run) -> list[str]:
    """Return, for each row of a run's tracks, the id of the correction that it depends on, "" for
    none; an empty list if the run has no corrections."""
    if not run.corrections:
        return []
    tracks = run.tracks
    return supporting_corrections(tracks.frames, tracks.ids, run.corrections, run.outcomes)


def given_names(run: Run) -> dict[int, str]:
    """Return the names that people were given by hand, by track id of a finished run."""
    return names_by_track(run.outcomes, run.corrections)


def key_without_identities(run: Run) -> str:
    """Return the key of stage 3 without corrections of identity, by which runs that differ in these
    alone share intermediate results."""
    others = tuple(one for one in run.corrections if one.kind in IN_THE_FUSION)
    return stage_keys(run.sequence, run.parameters, run.seed, others)["smoothing"]


def stage_keys(
    sequence: Sequence,
    parameters: RunParameters,
    seed: int,
    corrections: tuple[Correction, ...] = (),
) -> dict[Stage, str]:
    """Compute the cache key of each stage.

    A key is a hash of the sequence, the seed, the code, and of the parameters and corrections of
    the stage and of those before it.

    Args:
        sequence: The sequence to track in.
        parameters: The parameters of the run.
        seed: The seed of the run.
        corrections: The user's corrections.
    """
    keys: dict[Stage, str] = {}
    values: list[Any] = [sequence.digest, seed]
    stages: tuple[Stage, ...] = ("single_view", "fusion", "smoothing", "tracks")
    for stage in stages:
        method = parameters.method(CHOSEN_BY[stage])
        values += [numbers_version(stage), method_version(method), stage_values(parameters, stage)]
        if method.used(parameters).detector and sequence.detector is not None:
            values.append(sequence.detector.digest)
        applied = digest(corrections, _APPLIED_BY.get(stage, ()))
        if applied:
            values.append(applied)
        keys[stage] = hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()[:16]
    return keys
