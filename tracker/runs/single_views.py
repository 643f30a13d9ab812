"""Stage 1 of all cameras in parallel: each camera has a thread, and steps are yielded in order."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Hashable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from tracker import single_view
from tracker.runs.run import Cancelled, Run
from tracker.sequences.pictures.frames import Picture, Pictures
from tracker.single_view.colour.templates import Likeness, appearance_of
from tracker.single_view.protocol import SHAKE, SingleViewMethod, ViewResult
from tracker.single_view.rectification.sequence import RectifiedSequence

BLOCK = 5
"""The number of steps that a camera computes at a time: few, so that results arrive early; more
than one, so that passing work to a thread costs little."""

Cancel = Callable[[], bool]
"""A callback that returns whether to stop."""

_Made = TypeVar("_Made")


class SingleViews:
    """A context that iterates over the remaining steps of stage 1.

    Each step gives the results and the new states, one of each for each camera.
    """

    def __init__(
        self,
        run: Run,
        reader: Pictures,
        cancelled: Cancel,
        thread_begins: Callable[[], None] = lambda: None,
    ) -> None:
        """Prepare the threads.

        Args:
            run: The run, whose column of stage 1 is continued.
            reader: The reader of the pictures.
            cancelled: A callback that the cameras' threads ask before every picture.
            thread_begins: A callback that each of these threads calls first.
        """
        self._run = run
        self._cancelled = cancelled
        self._stopped = False
        stopping = _StoppingReader(reader, self._is_stopped)
        self._rectified = RectifiedSequence.of(run.sequence, run.parameters, stopping)
        self._pools = [
            ThreadPoolExecutor(1, f"single-view-{view.camera.name}", thread_begins)
            for view in run.sequence.views
        ]

    def __enter__(self) -> Iterator[tuple[tuple[ViewResult, ...], tuple[Any, ...]]]:
        return self._iterate()

    def __exit__(self, *_: object) -> None:
        self._stopped = True  # the threads end before their next picture
        for pool in self._pools:
            pool.shutdown(wait=True, cancel_futures=True)

    def _iterate(self) -> Iterator[tuple[tuple[ViewResult, ...], tuple[Any, ...]]]:
        """Yield the results and the states of all cameras after each step."""
        preparing = [pool.submit(self._prepare, c) for c, pool in enumerate(self._pools)]
        workers = [future.result() for future in preparing]
        blocks: deque[list[Future[list[tuple[ViewResult, Any]]]]] = deque()

        def order_block(steps: int = BLOCK) -> None:
            pairs = zip(self._pools, workers, strict=True)
            blocks.append([pool.submit(worker.block, steps) for pool, worker in pairs])

        order_block(1)  # the first step is wanted soon
        left = self._run.sequence.frames - len(self._run.views)
        while left > 0:
            order_block()  # is computed while the previous block is fused
            parts = [future.result() for future in blocks.popleft()]
            if self._cancelled():
                raise Cancelled
            for step in zip(*parts, strict=True):
                yield tuple(result for result, _ in step), tuple(state for _, state in step)
            left -= len(parts[0])

    def _is_stopped(self) -> bool:
        return self._stopped or self._cancelled()

    def _prepare(self, camera: int) -> _CameraWorker:
        """Create the method of one camera, in the camera's thread."""
        run = self._run
        method = single_view.create(
            run.parameters.single_view,
            self._rectified.sequence,
            camera,
            run.parameters,
            self._rectified.reader,
        )
        run.from_pictures = run.from_pictures or _uses_pictures(run)
        state = run.view_states[camera] if run.view_states is not None else method.start()
        return _CameraWorker(method, state, camera, run, self._rectified, self._is_stopped)


class _CameraWorker:
    """Stage 1 of one camera, which continues the run's column."""

    def __init__(
        self,
        method: SingleViewMethod,
        state: Any,
        camera: int,
        run: Run,
        rectified: RectifiedSequence,
        stopped: Cancel,
    ) -> None:
        self._rectified = rectified
        self._method = method
        self._state = state
        self._camera = camera
        self._view = run.sequence.views[camera]
        self._frame = len(run.views)
        self._frames = run.sequence.frames
        self._seed = run.seed
        self._stopped = stopped
        self._every = run.parameters.method("single_view").used(run.parameters).every
        pictures = _uses_pictures(run)
        self._shake = rectified.shake(camera) if pictures else 0.0
        self._pictures = rectified.reader.iterate(camera, self._frame) if pictures else None
        self._likeness = Likeness.of(rectified.sequence, rectified.reader) if pictures else None

    def block(self, steps: int) -> list[tuple[ViewResult, Any]]:
        """Compute the next few steps, and return the result and state of each; none at the end."""
        done: list[tuple[ViewResult, Any]] = []
        while len(done) < steps and self._frame < self._frames and not self._stopped():
            picture = next(self._pictures, None) if self._pictures is not None else None
            without = self._pictures is None and not self._view.detector_ran_at(self._frame)
            if without or self._frame % self._every:
                done.append((ViewResult.of_no_frame(), self._state))
                self._frame += 1
                continue
            rng = np.random.default_rng((self._seed, self._camera, self._frame))
            self._state, result = self._method.step(self._state, self._frame, picture, rng)
            if self._pictures is not None and picture is None:
                result = without_boxes(result)
            if picture is not None and self._likeness is not None:
                likenesses = self._likeness.of_boxes(picture, result.boxes)
                result = replace(result, likenesses=likenesses)
            if picture is not None:
                result = replace(result, embeddings=appearance_of(picture, result.boxes))
            if self._shake > 0.0:
                result = replace(result, information={**result.information, SHAKE: self._shake})
            done.append((self._rectified.back(self._camera, result), self._state))
            self._frame += 1
        return done


def _uses_pictures(run: Run) -> bool:
    return run.parameters.method("single_view").used(run.parameters).pictures


def without_boxes(result: ViewResult) -> ViewResult:
    """Return the result of a step without a picture: the method's estimates, without boxes for the
    fusion."""
    nothing = ViewResult.of_no_frame()
    return replace(
        result,
        boxes=nothing.boxes,
        weights=nothing.weights,
        labels=nothing.labels,
        sigmas=nothing.sigmas,
        log_ratios=nothing.log_ratios,
        blind=True,
    )


class _StoppingReader:
    """A reader of pictures that raises :class:`Cancelled` once the run is to stop.

    Learning the background or the templates takes many pictures before the first step; this ends
    it early.
    """

    def __init__(self, reader: Pictures, stopped: Cancel) -> None:
        self._reader = reader
        self._stopped = stopped

    def picture(self, camera: int, step: int) -> Picture | None:
        self.check()
        return self._reader.picture(camera, step)

    def iterate(self, camera: int, first: int = 0) -> Iterator[Picture | None]:
        return self._reader.iterate(camera, first)

    def empty(self, camera: int) -> Picture | None:
        return self._reader.empty(camera)

    def once(self, name: Hashable, make: Callable[[], _Made]) -> _Made:
        self.check()
        return self._reader.once(name, make)

    def check(self) -> None:
        if self._stopped():
            raise Cancelled
