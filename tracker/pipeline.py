"""Sequence + parameters → run: the three stages, step by step, with progress and cancel."""

from __future__ import annotations

import hashlib
import json
import time
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tracker import __version__, fusion, single_view
from tracker import parameters as parameter_table
from tracker import trajectories as tracks_stage
from tracker.fusion.protocol import FusionResult
from tracker.parameters import RunParameters, Stage
from tracker.sequences.frames import FrameReader
from tracker.sequences.sequence import Sequence
from tracker.single_view.protocol import SingleViewMethod, ViewResult
from tracker.trajectories import Trajectories

BLOCK = 5
"""Steps that a camera's stage 1 does at a time: few enough to stream, enough to pay."""

PROGRESS_SECONDS = 0.05
"""At most this often a run tells how far it is."""

Cancel = Callable[[], bool]


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

    @property
    def steps_per_second(self) -> float:
        """Mean speed so far."""
        return self.fresh / self.seconds if self.seconds > 0.0 else 0.0

    @property
    def seconds_left(self) -> float | None:
        """Estimated from the mean speed; None before the first step."""
        return (self.total - self.done) / self.steps_per_second if self.fresh else None


@dataclass(eq=False)
class Run:
    """One run: the columns of the three stages, filled step by step from step 0.

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
    """Stage 3 of the steps below :attr:`done`."""
    done: int = 0
    """Steps whose three stages are ready."""
    view_states: tuple[Any, ...] | None = None
    """State of stage 1, one a camera, after the last step of :attr:`views`."""
    fusion_state: Any = None
    """State of stage 2 after the last step of :attr:`fused`."""

    def __post_init__(self) -> None:
        self.tracks = Trajectories.empty(len(self.sequence.views))

    @property
    def key(self) -> str:
        """Hash of the sequence, all parameters, the seed and the version of the code's numbers."""
        return self.keys["tracks"]

    @property
    def complete(self) -> bool:
        """Whether every step is there."""
        return self.done == self.sequence.frames


def stage_keys(sequence: Sequence, parameters: RunParameters, seed: int) -> dict[Stage, str]:
    """The cache key of each stage: a hash of the sequence, seed and version and of the
    parameters of the stage itself and of those before it."""
    keys: dict[Stage, str] = {}
    values: list[Any] = [__version__, sequence.digest, seed]
    stages: tuple[Stage, ...] = ("single_view", "fusion", "tracks")
    for stage in stages:
        values.append(parameter_table.stage_values(parameters, stage))
        keys[stage] = hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()[:16]
    return keys


def default_parameters(sequence: Sequence) -> RunParameters:
    """Which methods follow from what the sequence has: pictures with templates, or boxes.

    People are fused by ``multi_bernoulli`` in either case.

    Raises:
        ValueError: If the sequence has neither.
    """
    if sequence.has_pictures and sequence.templates:
        return RunParameters(single_view="colour_phd", fusion_method="multi_bernoulli")
    if sequence.has_detections:
        return RunParameters(single_view="none", fusion_method="multi_bernoulli")
    if sequence.has_pictures:
        return RunParameters(single_view="colour_phd", fusion_method="multi_bernoulli")
    raise ValueError(
        f"{sequence.name}: every camera needs pictures (video or images), or every camera "
        "needs detections; add what is missing to sequence.toml"
    )


def compute(
    sequence: Sequence,
    parameters: RunParameters,
    *,
    seed: int = 0,
    steps: int | None = None,
    reader: FrameReader | None = None,
    previous: Run | None = None,
    on_progress: Callable[[Run, Progress], None] | None = None,
    cancelled: Cancel = lambda: False,
) -> Run:
    """Run the three stages over a sequence.

    Args:
        sequence: What to track in.
        parameters: Methods and their numbers.
        seed: Every camera and step draws from a generator of its own made of it, so
            the result depends neither on threads nor on where a run was resumed.
        steps: Stop after this many steps, for a first look; None for all.
        reader: The pictures; one is opened for the run where none is given.
        previous: A run, complete or not, whose stages are re-used as far as their
            keys agree. It is left as it is.
        on_progress: Called from this thread every so often, and at the end, with the
            run so far: its steps below ``done`` may be read.
        cancelled: Asked between steps.

    Returns:
        The run, complete unless ``steps`` says otherwise.

    Raises:
        Cancelled: If ``cancelled`` said so.
        ValueError: If the methods do not fit the sequence.
    """
    total = sequence.frames if steps is None else min(steps, sequence.frames)
    run = Run(sequence, parameters, seed, stage_keys(sequence, parameters, seed))
    _adopt(run, previous)
    stage: Stage = "single_view"
    if len(run.views) >= total:
        stage = "fusion" if len(run.fused) < total else "tracks"
    begin = time.perf_counter()
    first = len(run.fused)
    last_told = begin
    ids: dict[int, int] = {}
    parts: list[Trajectories] = []

    def publish() -> None:
        parts.append(
            tracks_stage.extract(
                run.fused[run.done :],
                cameras=len(sequence.views),
                extraction_threshold=parameters.fusion.extraction_threshold,
                rule=(
                    parameters.fusion.extraction
                    if parameters.fusion_method == "sequential_phd"
                    else "components"
                ),
                room=sequence.room,
                margin=parameters.fusion.room_margin,
                first_frame=run.done,
                ids=ids,
            )
        )
        run.tracks = tracks_stage.concatenate(parts, len(sequence.views))
        parts[:] = [run.tracks]
        run.done = len(run.fused)
        if on_progress is not None:
            seconds = time.perf_counter() - begin
            on_progress(run, Progress(stage, run.done, total, seconds, run.done - first))

    publish()
    method = fusion.create(sequence, parameters)
    state = run.fusion_state if run.fused else method.start()
    with ExitStack() as stack:
        if len(run.views) < total:
            if reader is None:
                reader = FrameReader(sequence)
                stack.callback(reader.close)
            single_views = stack.enter_context(_SingleViews(run, reader, cancelled))
        for frame in range(len(run.fused), total):
            if cancelled():
                raise Cancelled
            if frame == len(run.views):
                views, view_states = next(single_views)
                run.views.append(views)
                run.view_states = view_states
            state, result = method.step(state, run.views[frame])
            run.fused.append(result)
            run.fusion_state = state
            now = time.perf_counter()
            if now - last_told > PROGRESS_SECONDS:
                publish()
                last_told = now
    publish()
    return run


def _adopt(run: Run, previous: Run | None) -> None:
    """Take over the columns of an earlier run whose keys agree."""
    if previous is None:
        return
    if previous.keys["single_view"] == run.keys["single_view"]:
        run.views, run.view_states = list(previous.views), previous.view_states
    if previous.keys["fusion"] == run.keys["fusion"]:
        run.fused, run.fusion_state = list(previous.fused), previous.fusion_state


class _SingleViews:
    """Stage 1 of all cameras, each in a thread of its own, handed over step by step in order."""

    def __init__(self, run: Run, reader: FrameReader, cancelled: Cancel) -> None:
        self._run = run
        self._reader = reader
        self._cancelled = cancelled
        self._stopped = False
        self._pools = [
            ThreadPoolExecutor(1, f"single-view-{view.camera.name}") for view in run.sequence.views
        ]

    def __enter__(self) -> Iterator[tuple[tuple[ViewResult, ...], tuple[Any, ...]]]:
        return self._iterate()

    def __exit__(self, *_: object) -> None:
        self._stopped = True  # a block under way ends after its step
        for pool in self._pools:
            pool.shutdown(wait=True, cancel_futures=True)

    def _iterate(self) -> Iterator[tuple[tuple[ViewResult, ...], tuple[Any, ...]]]:
        preparing = [pool.submit(self._prepare, c) for c, pool in enumerate(self._pools)]
        workers = [future.result() for future in preparing]
        blocks: deque[list[Future[list[tuple[ViewResult, Any]]]]] = deque()

        def order_block() -> None:
            pairs = zip(self._pools, workers, strict=True)
            blocks.append([pool.submit(worker.block) for pool, worker in pairs])

        order_block()
        left = self._run.sequence.frames - len(self._run.views)
        while left > 0:
            order_block()  # is computed while the one before is fused
            parts = [future.result() for future in blocks.popleft()]
            if self._cancelled():
                raise Cancelled
            for step in zip(*parts, strict=True):
                yield tuple(result for result, _ in step), tuple(state for _, state in step)
            left -= len(parts[0])

    def _prepare(self, camera: int) -> _CameraWorker:
        run = self._run
        method = single_view.create(
            run.parameters.single_view, run.sequence, camera, run.parameters, self._reader
        )
        state = run.view_states[camera] if run.view_states is not None else method.start()
        return _CameraWorker(
            method, state, camera, run, self._reader, stopped=lambda: self._stopped
        )


class _CameraWorker:
    """Stage 1 of one camera, from where the run's column ends."""

    def __init__(
        self,
        method: SingleViewMethod,
        state: Any,
        camera: int,
        run: Run,
        reader: FrameReader,
        stopped: Cancel,
    ) -> None:
        self._method = method
        self._state = state
        self._camera = camera
        self._frame = len(run.views)
        self._frames = run.sequence.frames
        self._seed = run.seed
        self._stopped = stopped
        self._pictures = reader.iterate(camera, self._frame) if method.needs_pictures else None

    def block(self) -> list[tuple[ViewResult, Any]]:
        """The next few steps: result and state of each; none at the end."""
        done: list[tuple[ViewResult, Any]] = []
        while len(done) < BLOCK and self._frame < self._frames and not self._stopped():
            picture = next(self._pictures, None) if self._pictures is not None else None
            rng = np.random.default_rng((self._seed, self._camera, self._frame))
            self._state, result = self._method.step(self._state, self._frame, picture, rng)
            done.append((result, self._state))
            self._frame += 1
        return done
