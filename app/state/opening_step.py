"""Where a recording is opened: at a step where something can be seen.

Once the first run of a recording is there, and scored where there is a truth, the playhead
goes to that step by itself, unless somebody has moved it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
from jaxtyping import Int
from numpy import ndarray

from app.state.snapshot import Change, Snapshot
from app.state.workbench import Workbench

ORIGIN = "opening"

BEFORE = (2.0, 4.0)
"""Seconds before an event between two tracks: near enough to wait for it, far enough to see it
come."""


def opening_step(counts: Int[ndarray, " S"], switches: Iterable[int], fps: float) -> int:
    """The step to show first.

    Args:
        counts: Targets reported at each step.
        switches: Steps at which a person's identity went from one track to another.
        fps: Steps a second.

    Returns:
        The first with most people that lies shortly before a switch; else the first with most
        people; 0 where there is nobody.
    """
    if not len(counts) or not counts.max():
        return 0
    full = np.flatnonzero(counts == counts.max())
    events = np.asarray(sorted(switches), dtype=float)
    for step in full.tolist():
        wait = (events - step) / fps
        if np.any((wait >= BEFORE[0]) & (wait <= BEFORE[1])):
            return int(step)
    return int(full[0])


def follow(workbench: Workbench) -> Callable[[], None]:
    """Move the playhead there whenever a recording's first run is finished.

    Returns:
        A function that ends it.
    """

    def on_change(change: Change) -> None:
        if change not in ("run", "evaluation"):
            return
        now = workbench.snapshot()
        if not now.sought and is_settled(now):
            workbench.seek(step_of(now), ORIGIN)

    return workbench.subscribe(on_change)


def is_settled(now: Snapshot) -> bool:
    """Whether the run is finished, and its tracks are scored where they can be."""
    run, sequence, scored = now.run, now.sequence, now.scores.shown
    if sequence is None or run is None or not run.finished or now.run_state.key != run.key:
        return False
    if now.run_state.state != "done":
        return False
    return sequence.ground_truth is None or (scored is not None and scored.is_final_of(run))


def step_of(now: Snapshot) -> int:
    """The step to show first of a settled run."""
    assert now.run is not None
    assert now.sequence is not None
    counts = np.bincount(now.run.tracks.frames, minlength=now.sequence.frames)
    scored = now.scores.shown
    evaluation = scored.evaluation if scored is not None else None
    switches: list[int] = []
    if evaluation is not None:
        switches = evaluation.pairs.steps[evaluation.pairs.switch].tolist()
    return opening_step(counts, switches, now.sequence.fps)
