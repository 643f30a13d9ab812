"""The estimate of identity without truth: all looks, several at a time, and what they say."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tracker.fusion.trajectories import Trajectories
from tracker.review.self_consistency.agreement import (
    ReviewItem,
    agreement,
    compared,
    differences,
    doubts,
)
from tracker.review.self_consistency.calibration import interval
from tracker.review.self_consistency.others import Given, Look, looked, looks
from tracker.review.self_consistency.overlap import overlap
from tracker.runs.processes import WorkerControl, map_in_processes
from tracker.runs.run import Run

WARNING = (
    "Runs that agree may all be wrong alike: a tracker can be consistently wrong. "
    "This is an estimate, not a measurement."
)


@dataclass(frozen=True, slots=True)
class Estimate:
    """How well people are told apart, as far as the recording alone can say."""

    score: float
    """J = IDF1(forward, backwards) × mean over cameras of IDF1(all, all but one), 0 … 1."""
    backwards: float
    """IDF1 of the run backwards in time by the run as it is."""
    without: tuple[float, ...]
    """IDF1 without each camera; empty where there is only one."""
    overlaps: tuple[float | None, ...]
    """Of each camera's boxes with the people that the others found: a low one is a veto."""
    doubts: tuple[ReviewItem, ...]
    """The moments at which the runs disagree, the most doubtful first."""

    @property
    def interval(self) -> tuple[float, float]:
        """Between these IDF1 lay in nine of ten of the runs by which J was calibrated."""
        return interval(self.score)


def estimate(
    run: Run,
    *,
    processes: int = 1,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
    cancelled: Callable[[], bool] = lambda: False,
) -> Estimate:
    """Look at a run's recording in the other ways, and see how far they agree.

    Args:
        run: Its boxes of stage 1 are used as they are, its steps as far as they go.
        processes: Largest number of processes.
        on_progress: Called with the steps done in all ways, and how many there are.
        cancelled: Asked now and then whether to stop.

    Raises:
        tracker.runs.pipeline.Cancelled: If ``cancelled`` returned true.
        ValueError: If the run has no step yet.
    """
    if not run.done:
        raise ValueError(f"{run.sequence.name}: the run has no step yet; compute it first")
    sequence, steps = run.sequence, run.done
    given = Given(sequence, run.parameters, run.seed, tuple(run.views[:steps]))
    ways = looks(len(sequence.views))
    found = map_in_processes(
        _work,
        [(given, way) for way in ways],
        steps=steps * len(ways),
        processes=processes,
        on_progress=on_progress,
        cancelled=cancelled,
    )
    half = sequence.target_half_extents
    comparisons = [compared(run.tracks, other, steps, half) for other in found]
    agreed = [agreement(one) for one in comparisons]
    backwards, without = agreed[0], tuple(agreed[1:])
    score = backwards * (float(np.mean(without)) if without else 1.0)
    named = [
        (way.words(sequence), differences(one, sequence.step_time))
        for way, one in zip(ways, comparisons, strict=True)
    ]
    return Estimate(
        score,
        backwards,
        without,
        tuple(
            overlap(tracks, sequence.cameras[c], half, [step[c] for step in given.views])
            for c, tracks in enumerate(found[1:])
        ),
        doubts(named, sequence.step_time),
    )


def _work(item: tuple[Given, Look], control: WorkerControl) -> Trajectories:
    given, way = item
    return looked(given, way, control.advance, control.cancelled)
