"""The estimate of identity accuracy without ground truth: a run's variants and their agreement."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.fusion.trajectories import Trajectories
from tracker.geometry.assignment import linear_sum_assignment
from tracker.geometry.boxes import Boxes, box_overlaps
from tracker.geometry.camera import Camera
from tracker.parameters.catalogue import RunParameters
from tracker.review.self_consistency.agreement import (
    Disagreement,
    agreement,
    compare_runs,
    differences,
    disagreements,
)
from tracker.runs import pipeline
from tracker.runs.processes import WorkerControl, map_in_processes
from tracker.runs.run import Run, stage_keys
from tracker.sequences.sequence import Sequence
from tracker.single_view.protocol import ViewResult
from tracker.steps import Steps

WARNING = (
    "Runs that agree may all be wrong alike: a tracker can be consistently wrong. "
    "This is an estimate, not a measurement."
)

FILE = Path(__file__).with_name("calibration.json")
"""The calibration of the estimate: estimate and true IDF1 of runs with many settings, by
recording."""

_WITHIN = 0.9
"""Share of the nearest runs of the calibration whose error lies in the 90 % interval."""

_ALIKE = 60
"""The number of runs of the calibration, those with the nearest estimates, that give the interval.
Made from four of the five recordings, it contains IDF1 of 87 % of the runs of the fifth; with 15 of
75 %, with 30 of 79 % and with 120 of 87 %."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """The estimate of identity accuracy."""

    score: float
    """J = IDF1(forward, backwards) × mean over cameras of IDF1(all, all but one), 0 … 1."""
    backwards: float
    """IDF1 of the run backwards in time, with the run itself in the place of the truth."""
    without: tuple[float, ...]
    """IDF1 of the run without each camera, with the run itself in the place of the truth; empty if
    there is only one camera."""
    overlaps: tuple[float | None, ...]
    """The overlap of each camera's boxes with the tracks of the run without it (see
    :func:`overlap`), 0 … 1; if one is low, the estimate is not to be trusted."""
    disagreements: tuple[Disagreement, ...]
    """The moments at which the runs disagree, the most important first."""

    @property
    def interval(self) -> tuple[float, float]:
        """The 90 % interval of the true IDF1; see :func:`interval`."""
        return interval(self.score)


def estimate(
    run: Run,
    *,
    processes: int = 1,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
    cancelled: Callable[[], bool] = lambda: False,
) -> Estimate:
    """Track a run's recording in all variants, and measure how well they agree with the run.

    Args:
        run: The run, whose results of stage 1 are used as they are; only the steps that it has
            computed are tracked.
        processes: Largest number of processes.
        on_progress: A callback that gets the number of steps done in all variants, and the total
            number.
        cancelled: A callback that returns whether to stop; it is called every few steps.

    Raises:
        tracker.runs.pipeline.Cancelled: If ``cancelled`` returned true.
        ValueError: If the run has no step yet.
    """
    if not run.done:
        raise ValueError(f"{run.sequence.name}: the run has no step yet; compute it first")
    sequence, steps = run.sequence, run.done
    common = Common(sequence, run.parameters, run.seed, run.views.before(steps))
    every = variants(len(sequence.views))
    found = map_in_processes(
        _track_in_worker,
        [(common, variant) for variant in every],
        steps=steps * len(every),
        processes=processes,
        on_progress=on_progress,
        cancelled=cancelled,
    )
    half = sequence.target_half_extents
    comparisons = [compare_runs(run.tracks, other, steps, half) for other in found]
    agreed = [agreement(one) for one in comparisons]
    backwards, without = agreed[0], tuple(agreed[1:])
    score = backwards * (float(np.mean(without)) if without else 1.0)
    named = [
        (variant.words(sequence), differences(one, sequence.step_time))
        for variant, one in zip(every, comparisons, strict=True)
    ]
    return Estimate(
        score,
        backwards,
        without,
        tuple(
            overlap(tracks, sequence.cameras[c], half, common.views, c)
            for c, tracks in enumerate(found[1:])
        ),
        disagreements(named, sequence.step_time),
    )


def _track_in_worker(item: tuple[Common, Variant], control: WorkerControl) -> Trajectories:
    """Track one variant in a worker process."""
    common, variant = item
    return track_variant(common, variant, control.advance, control.cancelled)


@dataclass(frozen=True, slots=True)
class Variant:
    """A variant of a run. Stage 1, which takes the most time, is not computed again."""

    backwards: bool = False
    """Whether the steps are tracked in reverse order."""
    without: int | None = None
    """The index of the camera that is left out; None for none."""

    def words(self, sequence: Sequence) -> str:
        """Return the variant's name for display."""
        if self.without is not None:
            return f"without {sequence.views[self.without].camera.name}"
        return "backwards in time" if self.backwards else "as it is"


@dataclass(frozen=True, slots=True, eq=False)
class Common:
    """The input that all variants of a run have in common."""

    sequence: Sequence
    """The recording."""
    parameters: RunParameters
    """The parameters of the run."""
    seed: int
    """The seed of the run's random numbers."""
    views: Steps[tuple[ViewResult, ...]]
    """The results of stage 1 of each step, one for each camera."""


def variants(cameras: int) -> tuple[Variant, ...]:
    """Return the variants of a run with a number of cameras: backwards in time, and without each
    camera unless it is the only one."""
    left_out = [Variant(without=camera) for camera in range(cameras)] if cameras > 1 else []
    return (Variant(backwards=True), *left_out)


def track_variant(
    common: Common,
    variant: Variant,
    advance: Callable[[int], None] = lambda more: None,
    cancelled: Callable[[], bool] = lambda: False,
) -> Trajectories:
    """Track one variant, and return its tracks at the steps of the original recording.

    Args:
        common: The input that all variants have in common.
        variant: The variant.
        advance: A callback that gets the number of steps done since the last call.
        cancelled: A callback that returns whether to stop; it is called every few steps.

    Raises:
        tracker.runs.pipeline.Cancelled: If ``cancelled`` returned true.
    """
    kept = [c for c in range(len(common.sequence.views)) if c != variant.without]
    views = common.views.parts(kept)
    if variant.backwards:
        views = views.alike(reversed(views))
    digest = hashlib.sha256(f"{common.sequence.digest} {variant}".encode()).hexdigest()
    sequence = replace(
        common.sequence, views=tuple(common.sequence.views[c] for c in kept), digest=digest
    )
    keys = stage_keys(sequence, common.parameters, common.seed)
    seen = Run(sequence, common.parameters, common.seed, keys)
    seen.views = views
    reported = 0

    def on_progress(_: Run, progress: pipeline.Progress) -> None:
        nonlocal reported
        advance(progress.done - reported)
        reported = progress.done

    tracks = pipeline.compute(
        sequence,
        common.parameters,
        seed=common.seed,
        steps=len(views),
        previous=seen,
        on_progress=on_progress,
        cancelled=cancelled,
    ).tracks
    return reverse_steps(tracks, len(views)) if variant.backwards else tracks


def reverse_steps(tracks: Trajectories, steps: int) -> Trajectories:
    """Reverse the steps 0 … ``steps`` − 1 of tracks; rows are again sorted by step and then id."""
    order = np.lexsort((tracks.ids, -tracks.frames))
    ordered = tracks.take(order)
    return replace(ordered, frames=steps - 1 - ordered.frames)


def overlap(
    tracks: Trajectories,
    camera: Camera,
    half_extents: Float[ndarray, " 3"],
    views: Steps[tuple[ViewResult, ...]],
    number: int,
) -> float | None:
    """Return the mean overlap of a camera's boxes with the tracks of a run without this camera.

    With the pairs of boxes and reprojected boxes at each step that maximize the sum of their
    intersections over unions (IoU), it is

        2 Σ_pairs IoU / (number of boxes + number of tracks in the picture)

    with both numbers summed over all steps. It is 1 if boxes and reprojected boxes coincide one to
    one, and None without any boxes and tracks. Steps at which the camera had no frame are skipped.

    Args:
        tracks: The tracks of the run without this camera.
        camera: The camera.
        half_extents: Half width, depth and height of a target, metres.
        views: The results of stage 1 at each step.
        number: The index of the camera.
    """
    total, count = 0.0, 0
    every = views.column("boxes", number)
    for step, blind in enumerate(views.values("blind", number)):
        if blind:
            continue
        boxes = every[step]
        drawn, visible = camera.project_boxes(tracks.positions[tracks.at(step)], half_extents)
        drawn = drawn[visible]
        count += len(boxes) + len(drawn)
        if not len(boxes) or not len(drawn):
            continue
        shares = box_overlaps(drawn, Boxes(boxes).left_top)
        rows, columns = linear_sum_assignment(shares, maximize=True)
        total += 2.0 * float(shares[rows, columns].sum())
    return total / count if count else None


@cache
def _read_calibration() -> Float[ndarray, "K 2"]:
    """Return the estimate and the true IDF1 of K runs of the calibration, equally many of each
    recording."""
    kept = json.loads(FILE.read_text(encoding="utf-8"))
    fewest = min(len(pairs) for pairs in kept.values())
    return np.concatenate([np.array(pairs)[:fewest] for pairs in kept.values()])


def interval(score: float) -> tuple[float, float]:
    """Return the bounds of the 90 % interval of IDF1 for an estimate.

    They are the estimate plus the 5 % and the 95 % quantile of the error (true IDF1 − estimate) of
    the :data:`_ALIKE` runs of the calibration with the nearest estimates.
    """
    measured = _read_calibration()
    near = measured[np.argsort(np.abs(measured[:, 0] - score), kind="stable")[:_ALIKE]]
    errors = near[:, 1] - near[:, 0]
    low, high = np.quantile(errors, [(1.0 - _WITHIN) / 2.0, (1.0 + _WITHIN) / 2.0])
    return float(np.clip(score + low, 0.0, 1.0)), float(np.clip(score + high, 0.0, 1.0))
