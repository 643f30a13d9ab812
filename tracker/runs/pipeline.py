"""The pipeline: a sequence and parameters give a run, stage after stage, with progress."""

from __future__ import annotations

import inspect
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace

import numpy as np

from tracker import fusion, smoothing
from tracker.corrections import Correction
from tracker.corrections.kinds import leeway
from tracker.corrections.outcomes import outcomes
from tracker.fusion import trajectories as tracks_stage
from tracker.fusion.protocol import constraints_by_step
from tracker.fusion.trajectories import Bounds, GrowingTrajectories, Trajectories, apply_corrections
from tracker.parameters import Stage
from tracker.parameters.catalogue import RunParameters
from tracker.runs.fitting import default_parameters
from tracker.runs.gaps import where_to_keep
from tracker.runs.run import Cancelled, Progress, Run, key_without_identities, stage_keys
from tracker.runs.single_views import Cancel, SingleViews
from tracker.runs.stage_cache import FusionColumn, StageCache, TrackColumn, ViewColumn
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Sequence

__all__ = [
    "Cancelled", "Progress", "Run", "compute", "default_parameters", "stage_keys",
]  # fmt: skip

PROGRESS_SECONDS = 0.05
"""Least interval between two reports of a run's progress, seconds."""


def compute(
    sequence: Sequence,
    parameters: RunParameters,
    *,
    seed: int = 0,
    corrections: tuple[Correction, ...] = (),
    steps: int | None = None,
    reader: FrameReader | None = None,
    previous: Run | None = None,
    cache: StageCache | None = None,
    meanwhile: Trajectories | None = None,
    wanted: Callable[[], int] = lambda: 0,
    on_progress: Callable[[Run, Progress], None] | None = None,
    cancelled: Cancel = lambda: False,
    thread_begins: Callable[[], None] = lambda: None,
) -> Run:
    """Run the stages over a sequence.

    While the filter runs, ``tracks`` and ``filtered`` are both its tracks so far. When all steps
    are computed, the smoothing processes them together, and its tracks replace the filter's in
    ``tracks``; ``on_progress`` is called for both.

    Args:
        sequence: The sequence to track in.
        parameters: The methods and their parameters.
        seed: The seed; every camera and step has a generator of its own made from it, so that
            the result depends neither on threads nor on where a run was resumed.
        corrections: The user's corrections, in the order they were made. They are applied as far
            as they are compatible with the boxes; ``outcomes`` states which were.
        steps: The number of steps after which to stop; None for all.
        reader: The reader of the pictures; if None, one is opened for the run.
        previous: A run, complete or not, whose stages are re-used as far as their
            keys agree. It is not modified.
        cache: The cache of earlier runs' columns, which are re-used in the same way; the columns
            of this run are added to it at the end, or when it is cancelled.
        meanwhile: The tracks that ``on_progress`` gets, if all steps are fused already, until the
            smoothing is done; if None, it gets the filter's.
        wanted: A callback that returns the step that is displayed; progress is reported as soon as
            that step is computed.
        on_progress: A callback that is called from this thread at intervals, and at the end, with
            the run so far: its steps below ``done`` may be read.
        cancelled: A callback that returns whether to stop; it is called between steps and
            pictures, also by the threads of the cameras.
        thread_begins: A callback that each of these threads calls first, for instance to set its
            priority.

    Returns:
        The run, complete unless ``steps`` says otherwise.

    Raises:
        Cancelled: If ``cancelled`` returned true.
        ValueError: If a method cannot work on the sequence.
    """
    keys = stage_keys(sequence, parameters, seed, corrections)
    run = Run(sequence, parameters, seed, keys, corrections=corrections)
    total = sequence.frames if steps is None else min(steps, sequence.frames)
    _adopt(run, previous)
    if cache is not None:
        _take(run, cache)
    reused = len(run.views)
    reporter = _Reporter(run, total, wanted, on_progress, meanwhile)
    sound = False
    try:
        _fuse(run, total, reader, reporter, cancelled, thread_begins)
        # a file may have changed while it was read: nothing computed from it may be cached yet
        known = None if run.from_pictures and len(run.views) > reused else cache
        _smooth(run, total, reporter, cancelled, known)
        _correct(run, reporter)
        run.finished = run.complete
        sound = True
    except Cancelled:
        sound = True
        raise
    finally:
        if cache is not None:
            _keep(run, cache, fused=sound, read=run.from_pictures and len(run.views) > reused)
    return run


class _Reporter:
    """Extracts the tracks of the fused steps and reports them at suitable intervals."""

    def __init__(
        self,
        run: Run,
        total: int,
        wanted: Callable[[], int],
        on_progress: Callable[[Run, Progress], None] | None,
        meanwhile: Trajectories | None,
    ) -> None:
        self._run = run
        self._meanwhile = meanwhile if len(run.fused) >= total else None
        self._total = total
        self._wanted = wanted
        self._on_progress = on_progress
        self._first = len(run.fused)
        self._begin = self._last_report = time.perf_counter()
        self._preparing = 0.0
        self._growing: GrowingTrajectories | None = None
        self.ids: dict[int, int] = {}
        self._stage: Stage = "single_view"
        if len(run.views) >= total:
            self._stage = "fusion" if len(run.fused) < total else _last_stage(run)

    def fused(self) -> None:
        """Report that all steps are fused, and which stage is left."""
        self._stage = _last_stage(self._run)
        self.now()

    def after_step(self) -> None:
        """Report if the interval has passed, or if the displayed step is computed."""
        run, now = self._run, time.perf_counter()
        self._preparing = self._preparing or now - self._begin
        due = now - self._last_report > PROGRESS_SECONDS
        if due or run.done <= self._wanted() < len(run.fused):
            self.now()
            self._last_report = now

    def now(self) -> None:
        """Extract the tracks of all fused steps, and report them."""
        run = self._run
        if run.done < len(run.fused):
            self._growing = self._growing or GrowingTrajectories(run.filtered)
            run.tracks = run.filtered = self._growing.append(self._extract())
            run.done = len(run.fused)
        if self._meanwhile is not None and run.tracks is run.filtered:
            run.tracks = self._meanwhile
        if self._on_progress is not None:
            seconds = time.perf_counter() - self._begin
            fresh = run.done - self._first
            progress = Progress(self._stage, run.done, self._total, seconds, fresh, self._preparing)
            self._on_progress(run, progress)

    def forget_meanwhile(self) -> None:
        """Replace the tracks that were reported meanwhile by the filter's."""
        if self._meanwhile is not None and self._run.tracks is self._meanwhile:
            self._run.tracks = self._run.filtered
        self._meanwhile = None

    def _extract(self) -> Trajectories:
        """Return the tracks of the fused steps that have none yet."""
        run = self._run
        p = run.parameters.fusion
        used = run.parameters.method("fusion_method").used(run.parameters)
        return tracks_stage.extract(
            run.fused[run.done :],
            cameras=len(run.sequence.views),
            extraction_threshold=p.extraction_threshold,
            rule=p.extraction if used.reads_parameter("fusion", "extraction") else "components",
            bounds=_bounds(run),
            first_frame=run.done,
            ids=self.ids,
        )


def _fuse(
    run: Run,
    total: int,
    reader: FrameReader | None,
    reporter: _Reporter,
    cancelled: Cancel,
    thread_begins: Callable[[], None],
) -> None:
    """Compute stages 1 and 2 of those of the first ``total`` steps that are missing."""
    reporter.now()
    method = fusion.create(run.sequence, run.parameters)
    constraints = (
        constraints_by_step(run.corrections) if _accepts(method.step, "constraints") else {}
    )
    state = run.fusion_state if run.fused else method.start()
    with ExitStack() as stack:
        if len(run.views) < total:
            if reader is None:
                reader = FrameReader(run.sequence)
                stack.callback(reader.close)
            single_views = stack.enter_context(SingleViews(run, reader, cancelled, thread_begins))
        for frame in range(len(run.fused), total):
            if cancelled():
                raise Cancelled
            if frame == len(run.views):
                views, view_states = next(single_views)
                run.views.append(views)
                run.view_states = view_states
            if frame in constraints:
                state, result = method.step(state, run.views[frame], constraints[frame])
            else:
                state, result = method.step(state, run.views[frame])
            run.fused.append(result)
            run.fusion_state = state
            reporter.after_step()
    reporter.fused()


def _last_stage(run: Run) -> Stage:
    """Return the stage that a run without new fusion has to compute: smoothing, or tracks alone."""
    there = run.parameters.smoothing_method == "none" or run.smoothed is not None
    return "tracks" if there else "smoothing"


def _smooth(
    run: Run, total: int, reporter: _Reporter, cancelled: Cancel, cache: StageCache | None
) -> None:
    """Compute stage 3, and replace the filter's tracks by the smoothed ones."""
    reporter.forget_meanwhile()
    if run.parameters.smoothing_method == "none" or run.tracks is not run.filtered:
        return

    def check() -> None:
        if cancelled():
            raise Cancelled

    check()
    if run.smoothed is None:
        method = smoothing.create(run.sequence, run.parameters)
        views, fused = run.views.before(total), run.fused.before(total)
        if run.corrections and _accepts(method.smooth, "corrections"):
            more = {}
            if cache and total == run.sequence.frames and _accepts(method.smooth, "earlier"):
                more["earlier"] = cache.intermediate(key_without_identities(run))
            run.smoothed = method.smooth(views, fused, check, run.corrections, **more)
        else:
            run.smoothed = method.smooth(views, fused, check)
        if run.smoothed is None:
            return
    if run.smoothed.common:
        # the filter takes boxes of one step for independent as well
        added = run.smoothed.common * np.array([1.0, 1.0, 0.0])
        sigmas = np.sqrt(run.filtered.sigmas**2 + added)
        run.filtered = replace(run.filtered, sigmas=sigmas)
    run.tracks = smoothing.tracks_of(
        run.smoothed,
        run.fused,
        reporter.ids,
        extraction_threshold=run.parameters.fusion.extraction_threshold,
        bounds=_bounds(run),
        near=2.0 * float(run.sequence.target_half_extents[:2].mean()),
    )
    reporter.now()


def _correct(run: Run, reporter: _Reporter) -> None:
    """Apply the corrections of identity to the tracks if no earlier stage does, and determine the
    outcome of all corrections."""
    if not run.corrections or run.outcomes or not len(run.tracks):
        return
    step_time = run.sequence.step_time
    if not run.corrected and not run.parameters.method("smoothing_method").resolves_identities:
        run.tracks = apply_corrections(run.tracks, run.corrections, step_time)
    run.corrected = True
    tracks = run.tracks
    run.outcomes = outcomes(
        tracks.frames, tracks.ids, tracks.positions, run.corrections, leeway=leeway(step_time)
    )
    reporter.now()


def _accepts(function: Callable[..., object], name: str) -> bool:
    """Whether a function, which may be a plugin's, has a parameter of this name."""
    return name in inspect.signature(function).parameters


def _bounds(run: Run) -> Bounds:
    """Return the bounds within which people are reported."""
    below = float(run.sequence.target_half_extents[2]) / 2.0
    return Bounds(run.sequence.room, run.parameters.fusion.room_margin, below)


def _adopt(run: Run, previous: Run | None) -> None:
    """Re-use the columns of an earlier run whose keys agree."""
    if previous is None or previous.only_tracks:
        return
    if previous.keys["single_view"] == run.keys["single_view"]:
        run.views, run.view_states = previous.views.shared(), previous.view_states
        run.from_pictures = previous.from_pictures
    if previous.keys["fusion"] == run.keys["fusion"]:
        run.fused, run.fusion_state = previous.fused.shared(), previous.fusion_state
    if previous.keys["smoothing"] == run.keys["smoothing"] and previous.complete:
        run.smoothed = previous.smoothed


def _take(run: Run, cache: StageCache) -> None:
    """Re-use the columns of the cache that are longer than those of the run."""
    frames, cameras = run.sequence.frames, len(run.sequence.views)
    views = cache.views(run.keys["single_view"], frames=frames, cameras=cameras)
    if views is not None and len(views.steps) > len(run.views):
        run.views, run.view_states = views.steps.shared(), views.states
        run.from_pictures = views.from_pictures
    fused = cache.fusion(run.keys["fusion"])
    if fused is not None and len(fused.steps) > len(run.fused):
        run.fused, run.fusion_state = fused.steps.shared(), fused.state
    if len(run.fused) < frames:
        return
    run.smoothed = run.smoothed or cache.smoothed(run.keys["smoothing"])
    found = cache.tracks(run.key)
    if found is not None and _last_stage(run) == "tracks":
        run.tracks, run.filtered, run.done = found.tracks, found.filtered, frames
        run.corrected = True


def _keep(run: Run, cache: StageCache, *, fused: bool, read: bool) -> None:
    """Add the run's columns to the cache.

    Args:
        run: The run.
        cache: The cache.
        fused: Whether no stage failed, so that the columns after stage 1 may be kept too.
        read: Whether pictures were read, so that the files have to be checked for changes.
    """
    place = where_to_keep(run) if read else "everywhere"
    if place == "nowhere":
        return
    if run.views:
        column = ViewColumn(run.views, run.view_states, run.from_pictures)
        complete = len(run.views) == run.sequence.frames and place == "everywhere"
        cache.keep_views(run.keys["single_view"], column, complete=complete)
    if fused and run.fused:
        cache.keep_fusion(run.keys["fusion"], FusionColumn(run.fused, run.fusion_state))
    if fused and run.complete:
        if run.smoothed is not None:
            cache.keep_smoothed(run.keys["smoothing"], run.smoothed)
        if _last_stage(run) == "tracks":
            cache.keep_tracks(run.key, TrackColumn(run.tracks, run.filtered))
