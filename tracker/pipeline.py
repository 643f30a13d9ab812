"""Sequence + parameters → run: the three stages, step by step, with progress and cancel."""

from __future__ import annotations

import hashlib
import json
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tracker import __version__
from tracker import fusion as fusion_methods
from tracker import parameters as parameter_table
from tracker import single_view as single_view_methods
from tracker import trajectories as tracks_stage
from tracker.fusion.protocol import FusionResult
from tracker.parameters import RunParameters, Stage
from tracker.sequences.frames import FrameReader
from tracker.sequences.sequence import Sequence
from tracker.single_view.protocol import ViewResult
from tracker.trajectories import Trajectories

BLOCK = 5
"""Steps that stage 1 hands over at a time: small enough to stream, large enough to pay."""


class Cancelled(Exception):
    """The run was superseded or stopped; what was computed stays usable."""


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a run is."""

    stage: Stage
    """The stage that is at work."""
    done: int
    """Steps whose tracks are ready, from step 0 on."""
    total: int
    seconds: float
    """Since the run began."""

    @property
    def steps_per_second(self) -> float:
        """Mean speed so far."""
        return self.done / self.seconds if self.seconds > 0.0 else 0.0

    @property
    def seconds_left(self) -> float | None:
        """Estimated from the mean speed; None before the first step."""
        return (self.total - self.done) / self.steps_per_second if self.done else None


@dataclass(eq=False)
class Run:
    """One run: the columns of the three stages, filled step by step from step 0.

    One thread appends; any thread may read what is below :attr:`done`.
    """

    sequence: Sequence
    parameters: RunParameters
    seed: int
    key: str
    """Hash of the sequence, all parameters, the seed and the version of the code's numbers."""
    views: list[tuple[ViewResult, ...]] = field(default_factory=list)
    """Stage 1 of each step, one result a camera."""
    fused: list[FusionResult] = field(default_factory=list)
    """Stage 2 of each step."""
    tracks: Trajectories = field(init=False)
    """Stage 3 of the steps below :attr:`done`."""
    done: int = 0
    """Steps whose three stages are ready."""

    def __post_init__(self) -> None:
        self.tracks = Trajectories.empty(len(self.sequence.views))

    @property
    def complete(self) -> bool:
        """Whether every step is there."""
        return self.done == self.sequence.frames


def stage_key(sequence: Sequence, parameters: RunParameters, seed: int, stage: Stage) -> str:
    """The cache key of a stage: sequence, its own parameters and those before it, seed, version."""
    stages: tuple[Stage, ...] = ("single_view", "fusion", "tracks")
    values = [
        parameter_table.stage_values(parameters, s) for s in stages[: stages.index(stage) + 1]
    ]
    text = json.dumps([__version__, sequence.digest, seed, values], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]
