"""A run: the columns of its stages, its keys, and how far it is."""

from __future__ import annotations

import copy
import hashlib
import json
from dataclasses import dataclass, field
from typing import Any

from tracker.corrections.kinds import IN_THE_FUSION, OF_PEOPLE, Correction, Kind, digest
from tracker.corrections.outcomes import Outcome, names_by_track, supporting_corrections
from tracker.fusion.protocol import FusionResult
from tracker.fusion.trajectories import Trajectories
from tracker.parameters import RunParameters, Stage, stage_values
from tracker.parameters.reading import CHOSEN_BY
from tracker.runs.numbers_version import method_version, numbers_version
from tracker.sequences.sequence import Sequence
from tracker.single_view.protocol import ViewResult
from tracker.smoothing import Smoothed


class Cancelled(Exception):
    """The run was superseded or stopped; what was computed stays usable."""


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a run is."""

    stage: Stage
    """The first stage that had to be computed: the one that takes the time."""
    done: int
    """Steps whose tracks are ready, from step 0 on."""
    total: int
    seconds: float
    """Since the run began."""
    fresh: int
    """Steps that this run computed itself, rather than took from an earlier one."""
    preparing: float = 0.0
    """Seconds until the first of them was there: a background to learn, kernels to load."""

    @property
    def steps_per_second(self) -> float:
        """Mean speed so far, from the first step on: the preparation does not come again."""
        if self.fresh > 1 and self.seconds > self.preparing:
            return (self.fresh - 1) / (self.seconds - self.preparing)
        return self.fresh / self.seconds if self.seconds > 0.0 else 0.0

    @property
    def seconds_left(self) -> float | None:
        """Estimated from the mean speed; None before the first step."""
        return (self.total - self.done) / self.steps_per_second if self.fresh else None


@dataclass(eq=False)
class Run:
    """One run: the columns of its stages, filled step by step from step 0.

    One thread appends; any thread may read what is below :attr:`done`.
    """

    sequence: Sequence
    parameters: RunParameters
    seed: int
    keys: dict[Stage, str]
    """The cache key of each stage."""
    views: list[tuple[ViewResult, ...]] = field(default_factory=list)
    """Stage 1 of each step, one result a camera."""
    fused: list[FusionResult] = field(default_factory=list)
    """Stage 2 of each step."""
    tracks: Trajectories = field(init=False)
    """The people of the steps below :attr:`done`: those of the filter while it runs, and the
    smoothed ones in their place once :attr:`smoothed` is there."""
    filtered: Trajectories = field(init=False)
    """The people as the filter alone has them, which is what a live system would see."""
    smoothed: Smoothed | None = None
    """Stage 3 of all steps that were asked for; None until then, or where it is switched off."""
    done: int = 0
    """Steps whose people are there, be it the filter's."""
    view_states: tuple[Any, ...] | None = None
    """State of stage 1, one a camera, after the last step of :attr:`views`; None where that is
    the last of the sequence."""
    costly: bool = False
    """Whether stage 1 looked at pictures."""
    fusion_state: Any = None
    """State of stage 2 after the last step of :attr:`fused`."""
    corrections: tuple[Correction, ...] = ()
    """What a person said, which the run obeys."""
    outcomes: tuple[Outcome, ...] = ()
    """What became of each of them, once all steps are there."""
    settled: bool = False
    """Whether :attr:`tracks` has them."""
    finished: bool = False
    """Whether every stage has been through all steps of the sequence: :attr:`tracks` are replaced
    no more, and a figure made of them is the run's."""

    def __post_init__(self) -> None:
        self.tracks = self.filtered = Trajectories.empty(len(self.sequence.views))

    @property
    def key(self) -> str:
        """Hash of the sequence, all parameters, the seed and the version of the code's numbers."""
        return self.keys["tracks"]

    @property
    def revision(self) -> int:
        """How often the people of all steps took the place of others: a step is told by the run's
        key and this number.

        0 while they are the filter's; 1 once they are the smoothed ones, or corrected ones where
        nothing is smoothed; 2 once those who are smoothed have what a person said, too.
        """
        return (self.tracks is not self.filtered) + (self.settled and bool(self.corrections))

    @property
    def complete(self) -> bool:
        """Whether every step is there."""
        return self.done == self.sequence.frames

    def still(self) -> Run:
        """The run as it is now, for those who look at its people more than once: what computes it
        may put the smoothed ones in their place meanwhile."""
        return copy.copy(self)


_OBEYED_BY: dict[Stage, tuple[Kind, ...]] = {
    "fusion": IN_THE_FUSION, "smoothing": OF_PEOPLE,
}  # fmt: skip
"""The corrections that a stage obeys."""


def resting_of(run: Run) -> list[str]:
    """The id of the correction that each row of a run's tracks rests on; empty without any."""
    if not run.corrections:
        return []
    tracks = run.tracks
    return supporting_corrections(
        tracks.frames, tracks.ids, tracks.positions, run.corrections, run.outcomes
    )


def given_names(run: Run) -> dict[int, str]:
    """What people were called by hand, by track of a finished run."""
    return names_by_track(run.outcomes, run.corrections)


def key_without_names(run: Run) -> str:
    """The key of stage 3 without what a person said of who is who: what it begins with."""
    said = tuple(one for one in run.corrections if one.kind in IN_THE_FUSION)
    return stage_keys(run.sequence, run.parameters, run.seed, said)["smoothing"]


def stage_keys(
    sequence: Sequence,
    parameters: RunParameters,
    seed: int,
    corrections: tuple[Correction, ...] = (),
) -> dict[Stage, str]:
    """The cache key of each stage: a hash of the sequence, the seed, the code, and of the
    parameters and corrections of the stage itself and of those before it."""
    keys: dict[Stage, str] = {}
    values: list[Any] = [sequence.digest, seed]
    stages: tuple[Stage, ...] = ("single_view", "fusion", "smoothing", "tracks")
    for stage in stages:
        method = parameters.method(CHOSEN_BY[stage])
        values += [numbers_version(stage), method_version(method), stage_values(parameters, stage)]
        if method.used(parameters).detector and sequence.detector is not None:
            values.append(sequence.detector.digest)
        told = digest(corrections, _OBEYED_BY.get(stage, ()))
        if told:
            values.append(told)
        keys[stage] = hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()[:16]
    return keys
