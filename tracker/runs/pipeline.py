"""Sequence + parameters → run: stage after stage, with progress and cancel."""

from __future__ import annotations

import inspect
import time
from collections.abc import Callable
from contextlib import ExitStack

from tracker import fusion, smoothing
from tracker.corrections import Correction
from tracker.corrections.kinds import leeway
from tracker.corrections.outcomes import outcomes
from tracker.fusion import trajectories as tracks_stage
from tracker.fusion.place_constraints import constraints_by_step
from tracker.fusion.trajectories import Bounds, Trajectories, corrected
from tracker.parameters import RunParameters, Stage
from tracker.runs.fitting import default_parameters
from tracker.runs.gaps import where_to_keep
from tracker.runs.run import Cancelled, Progress, Run, key_without_names, stage_keys
from tracker.runs.single_views import Cancel, SingleViews
from tracker.runs.stage_cache import FusionColumn, StageCache, TrackColumn, ViewColumn
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Sequence

__all__ = [
    "Cancelled", "Progress", "Run", "compute", "default_parameters", "stage_keys",
]  # fmt: skip

PROGRESS_SECONDS = 0.05
"""At most this often a run tells how far it is."""


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

    Step by step the run has what the filter says of the people, in ``tracks`` and ``filtered``
    alike. When all steps are there, the smoothing looks at them together, and its people take
    the place of the filter's in ``tracks``; ``on_progress`` is told of both.

    Args:
        sequence: What to track in.
        parameters: Methods and their numbers.
        seed: Every camera and step draws from a generator of its own made of it, so
            the result depends neither on threads nor on where a run was resumed.
        corrections: What a person said, in its order. They are obeyed as far as the boxes still
            meet them, and ``outcomes`` tells which are.
        steps: Stop after this many steps, for a first look; None for all.
        reader: The pictures; one is opened for the run where none is given.
        previous: A run, complete or not, whose stages are re-used as far as their
            keys agree. It is left as it is.
        cache: Columns of earlier runs, re-used in the same way; those of this run are
            kept there at its end, or as far as they came where it is cancelled.
        meanwhile: What ``on_progress`` is shown of the people, where all steps are fused already,
            until the smoothing has looked at them: nothing, if none are given, but the filter's.
        wanted: The step that somebody looks at; it is told of the moment it is there.
        on_progress: Called from this thread every so often, and at the end, with the
            run so far: its steps below ``done`` may be read.
        cancelled: Asked between steps and pictures, also by the threads of the cameras.
        thread_begins: Called first in each of these threads, for instance to set its priority.

    Returns:
        The run, complete unless ``steps`` says otherwise.

    Raises:
        Cancelled: If ``cancelled`` said so.
        ValueError: If the methods do not fit the sequence.
    """
    keys = stage_keys(sequence, parameters, seed, corrections)
    run = Run(sequence, parameters, seed, keys, corrections=corrections)
    total = sequence.frames if steps is None else min(steps, sequence.frames)
    _adopt(run, previous)
    if cache is not None:
        _take(run, cache)
    taken = len(run.views)
    telling = _Telling(run, total, wanted, on_progress, meanwhile)
    sound = False
    try:
        _fuse(run, total, reader, telling, cancelled, thread_begins)
        # what changed while it was read is nothing to go on from
        known = None if run.costly and len(run.views) > taken else cache
        _smooth(run, total, telling, cancelled, known)
        _settle(run, telling)
        run.finished = run.complete
        sound = True
    except Cancelled:
        sound = True
        raise
    finally:
        if cache is not None:
            _keep(run, cache, fused=sound, read=run.costly and len(run.views) > taken)
    return run


class _Telling:
    """Makes the tracks of what is fused and tells of them, not too often and not too late."""

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
        self._begin = self._last_told = time.perf_counter()
        self._preparing = 0.0
        self.ids: dict[int, int] = {}
        self._stage: Stage = "single_view"
        if len(run.views) >= total:
            self._stage = "fusion" if len(run.fused) < total else _last_stage(run)

    def after_step(self) -> None:
        """Tell if it is time."""
        run, now = self._run, time.perf_counter()
        self._preparing = self._preparing or now - self._begin
        if now - self._last_told > PROGRESS_SECONDS or run.done <= self._wanted() < len(run.fused):
            self.now()
            self._last_told = now

    def now(self) -> None:
        """Make the tracks of all steps that are fused, and tell."""
        run = self._run
        if run.done < len(run.fused):
            run.tracks = run.filtered = tracks_stage.concatenate(
                [run.filtered, self._extract()], len(run.sequence.views)
            )
            run.done = len(run.fused)
        if self._meanwhile is not None and run.tracks is run.filtered:
            run.tracks = self._meanwhile
        if self._on_progress is not None:
            seconds = time.perf_counter() - self._begin
            fresh = run.done - self._first
            progress = Progress(self._stage, run.done, self._total, seconds, fresh, self._preparing)
            self._on_progress(run, progress)

    def forget_meanwhile(self) -> None:
        """Have the filter's people again instead of what was shown meanwhile."""
        if self._meanwhile is not None and self._run.tracks is self._meanwhile:
            self._run.tracks = self._run.filtered
        self._meanwhile = None

    def _extract(self) -> Trajectories:
        run = self._run
        p = run.parameters.fusion
        used = run.parameters.method("fusion_method").used(run.parameters)
        return tracks_stage.extract(
            run.fused[run.done :],
            cameras=len(run.sequence.views),
            extraction_threshold=p.extraction_threshold,
            rule=p.extraction if used.reads_number("fusion", "extraction") else "components",
            bounds=_bounds(run),
            first_frame=run.done,
            ids=self.ids,
        )


def _fuse(
    run: Run,
    total: int,
    reader: FrameReader | None,
    telling: _Telling,
    cancelled: Cancel,
    thread_begins: Callable[[], None],
) -> None:
    """Compute what is missing of the first ``total`` steps."""
    telling.now()
    method = fusion.create(run.sequence, run.parameters)
    told = constraints_by_step(run.corrections) if _takes(method.step, "constraints") else {}
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
            if frame in told:
                state, result = method.step(state, run.views[frame], told[frame])
            else:
                state, result = method.step(state, run.views[frame])
            run.fused.append(result)
            run.fusion_state = state
            telling.after_step()
    telling.now()


def _last_stage(run: Run) -> Stage:
    """What is left of a run that is fused."""
    there = run.parameters.smoothing_method == "none" or run.smoothed is not None
    return "tracks" if there else "smoothing"


def _smooth(
    run: Run, total: int, telling: _Telling, cancelled: Cancel, cache: StageCache | None
) -> None:
    """Put the smoothed people in the place of the filter's."""
    telling.forget_meanwhile()
    if run.parameters.smoothing_method == "none" or run.tracks is not run.filtered:
        return

    def check() -> None:
        if cancelled():
            raise Cancelled

    check()
    if run.smoothed is None:
        method = smoothing.create(run.sequence, run.parameters)
        views, fused = run.views[:total], run.fused[:total]
        if run.corrections and _takes(method.smooth, "corrections"):
            more = {}
            if cache and total == run.sequence.frames and _takes(method.smooth, "earlier"):
                more["earlier"] = cache.on_the_way(key_without_names(run))
            run.smoothed = method.smooth(views, fused, check, run.corrections, **more)
        else:
            run.smoothed = method.smooth(views, fused, check)
        if run.smoothed is None:
            return
    run.tracks = smoothing.tracks_of(
        run.smoothed,
        run.fused,
        telling.ids,
        extraction_threshold=run.parameters.fusion.extraction_threshold,
        bounds=_bounds(run),
        near=2.0 * float(run.sequence.target_half_extents[:2].mean()),
    )
    telling.now()


def _settle(run: Run, telling: _Telling) -> None:
    """Have the corrections in the tracks where no stage before settles who is who, and see which
    are met."""
    if not run.corrections or run.outcomes or not len(run.tracks):
        return
    step_time = run.sequence.step_time
    if not run.settled and not run.parameters.method("smoothing_method").settles_who:
        run.tracks = corrected(run.tracks, run.corrections, step_time)
    run.settled = True
    tracks = run.tracks
    run.outcomes = outcomes(
        tracks.frames, tracks.ids, tracks.positions, run.corrections, leeway=leeway(step_time)
    )
    telling.now()


def _takes(function: Callable[..., object], name: str) -> bool:
    """Whether a method of whoever wrote it takes an argument."""
    return name in inspect.signature(function).parameters


def _bounds(run: Run) -> Bounds:
    """Where people are reported."""
    below = float(run.sequence.target_half_extents[2]) / 2.0
    return Bounds(run.sequence.room, run.parameters.fusion.room_margin, below)


def _adopt(run: Run, previous: Run | None) -> None:
    """Take over the columns of an earlier run whose keys agree."""
    if previous is None:
        return
    if previous.keys["single_view"] == run.keys["single_view"]:
        run.views, run.view_states = list(previous.views), previous.view_states
        run.costly = previous.costly
    if previous.keys["fusion"] == run.keys["fusion"]:
        run.fused, run.fusion_state = list(previous.fused), previous.fusion_state
    if previous.keys["smoothing"] == run.keys["smoothing"] and previous.complete:
        run.smoothed = previous.smoothed


def _take(run: Run, cache: StageCache) -> None:
    """Take over columns that are longer than what the run has."""
    frames, cameras = run.sequence.frames, len(run.sequence.views)
    views = cache.views(run.keys["single_view"], frames=frames, cameras=cameras)
    if views is not None and len(views.steps) > len(run.views):
        run.views, run.view_states = list(views.steps), views.states
        run.costly = views.costly
    fused = cache.fusion(run.keys["fusion"])
    if fused is not None and len(fused.steps) > len(run.fused):
        run.fused, run.fusion_state = list(fused.steps), fused.state
    if len(run.fused) < frames:
        return
    run.smoothed = run.smoothed or cache.smoothed(run.keys["smoothing"])
    found = cache.tracks(run.key)
    if found is not None and _last_stage(run) == "tracks":
        run.tracks, run.filtered, run.done = found.tracks, found.filtered, frames
        run.settled = True


def _keep(run: Run, cache: StageCache, *, fused: bool, read: bool) -> None:
    """Keep the run's columns for later ones; those of the fusion unless it failed.

    Args:
        run: Whose.
        cache: Where.
        fused: Whether the fusion did not fail.
        read: Whether pictures were read: then the files are looked at again.
    """
    place = where_to_keep(run) if read else "everywhere"
    if place == "nowhere":
        return
    if run.views:
        column = ViewColumn(run.views, run.view_states, run.costly)
        complete = len(run.views) == run.sequence.frames and place == "everywhere"
        cache.keep_views(run.keys["single_view"], column, complete=complete)
    if fused and run.fused:
        cache.keep_fusion(run.keys["fusion"], FusionColumn(run.fused, run.fusion_state))
    if fused and run.complete:
        if run.smoothed is not None:
            cache.keep_smoothed(run.keys["smoothing"], run.smoothed)
        if _last_stage(run) == "tracks":
            cache.keep_tracks(run.key, TrackColumn(run.tracks, run.filtered))
