"""The same recording looked at in other ways: backwards in time, or without one of its cameras.

Stage 1 is taken as it was: it is the same for each camera by itself, and by far the costliest.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from tracker.fusion.trajectories import Trajectories
from tracker.parameters import RunParameters
from tracker.runs import pipeline
from tracker.runs.run import Run, stage_keys
from tracker.sequences.sequence import Sequence
from tracker.single_view.protocol import ViewResult


@dataclass(frozen=True, slots=True)
class Look:
    """One way to look at a recording."""

    backwards: bool = False
    without: int | None = None
    """A camera's index; None for all of them."""

    def words(self, sequence: Sequence) -> str:
        """What it is called."""
        if self.without is not None:
            return f"without {sequence.views[self.without].camera.name}"
        return "backwards in time" if self.backwards else "as it is"


@dataclass(frozen=True, slots=True, eq=False)
class Given:
    """What every look needs: what stage 1 found at each step, and how it goes on."""

    sequence: Sequence
    parameters: RunParameters
    seed: int
    views: tuple[tuple[ViewResult, ...], ...]


def looks(cameras: int) -> tuple[Look, ...]:
    """Those that a recording of so many cameras is held against: one alone cannot be left out."""
    left_out = [Look(without=camera) for camera in range(cameras)] if cameras > 1 else []
    return (Look(backwards=True), *left_out)


def looked(
    given: Given,
    look: Look,
    advance: Callable[[int], None] = lambda more: None,
    cancelled: Callable[[], bool] = lambda: False,
) -> Trajectories:
    """The people that one way to look finds, at the steps of the recording as it is.

    Raises:
        tracker.runs.pipeline.Cancelled: If ``cancelled`` said so.
    """
    kept = [c for c in range(len(given.sequence.views)) if c != look.without]
    views = [tuple(step[c] for c in kept) for step in given.views]
    if look.backwards:
        views = views[::-1]
    digest = hashlib.sha256(f"{given.sequence.digest} {look}".encode()).hexdigest()
    sequence = replace(
        given.sequence, views=tuple(given.sequence.views[c] for c in kept), digest=digest
    )
    keys = stage_keys(sequence, given.parameters, given.seed)
    seen = Run(sequence, given.parameters, given.seed, keys)
    seen.views = views
    told = 0

    def on_progress(_: Run, progress: pipeline.Progress) -> None:
        nonlocal told
        advance(progress.done - told)
        told = progress.done

    tracks = pipeline.compute(
        sequence,
        given.parameters,
        seed=given.seed,
        steps=len(views),
        previous=seen,
        on_progress=on_progress,
        cancelled=cancelled,
    ).tracks
    return mirrored(tracks, len(views)) if look.backwards else tracks


def mirrored(tracks: Trajectories, steps: int) -> Trajectories:
    """The last of some steps first, sorted by step and then id as all are."""
    order = np.lexsort((tracks.ids, -tracks.frames))
    columns = {name: getattr(tracks, name)[order] for name in Trajectories.__slots__}
    columns["frames"] = steps - 1 - columns["frames"]
    return Trajectories(**columns)
