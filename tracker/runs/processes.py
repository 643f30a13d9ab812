"""Work distributed over processes of this machine, with progress and cancellation."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass
from typing import Any, TypeVar

from tracker.runs.run import Cancelled

Item = TypeVar("Item")
Answer = TypeVar("Answer")

POLL_SECONDS = 0.1
"""Interval at which progress is reported and cancellation is checked, seconds."""


@dataclass(frozen=True, slots=True)
class WorkerControl:
    """The callbacks that a worker process gets, for progress and cancellation."""

    advance: Callable[[int], None]
    """Called with the number of steps done since the last call."""
    cancelled: Callable[[], bool]


_shared: dict[str, Any] = {}
"""In a worker process: the step counter and the stop event that all workers share."""


def available_cores() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def map_in_processes(
    work: Callable[[Item, WorkerControl], Answer],
    items: Sequence[Item],
    *,
    steps: int,
    processes: int = 1,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
    cancelled: Callable[[], bool] = lambda: False,
) -> list[Answer]:
    """Apply a function to every item, several items at a time.

    Args:
        work: A function of a module, so that another process can import it.
        items: Values that can be pickled.
        steps: The total number of steps of all items.
        processes: Largest number of processes; with 1 the work is done in this one.
        on_progress: A callback that gets the number of steps done, and ``steps``.
        cancelled: A callback that returns whether to stop; it is called at intervals.

    Returns:
        The results, in the order of the items.

    Raises:
        Cancelled: If ``cancelled`` returned true.
    """
    on_progress(0, steps)
    if min(processes, len(items)) <= 1:
        return [
            work(item, _control_here(index * steps // len(items), steps, on_progress, cancelled))
            for index, item in enumerate(items)
        ]
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor

    spawn = multiprocessing.get_context("spawn")  # a fork would copy locks that threads hold
    stop, counter = spawn.Event(), spawn.Value("q", 0)
    pool = ProcessPoolExecutor(
        min(processes, len(items)),
        mp_context=spawn,
        initializer=_begin,
        initargs=(stop, counter),
    )
    futures: list[Future[Answer]] = []
    try:
        futures += [pool.submit(_do, work, item) for item in items]
        pending = set(futures)
        while pending:
            done, pending = wait(pending, POLL_SECONDS, FIRST_COMPLETED)
            for future in done:
                future.result()  # raises what the work raised, which ends all others
            on_progress(min(counter.value, steps), steps)
            if cancelled():
                raise Cancelled
    finally:
        stop.set()
        pool.shutdown(wait=True, cancel_futures=True)
    on_progress(steps, steps)
    return [future.result() for future in futures]


def _control_here(
    done: int, steps: int, on_progress: Callable[[int, int], None], cancelled: Callable[[], bool]
) -> WorkerControl:
    def advance(more: int) -> None:
        nonlocal done
        done += more
        on_progress(min(done, steps), steps)

    return WorkerControl(advance, cancelled)


def _begin(stop: Any, counter: Any) -> None:
    """Prepare a worker process."""
    import multiprocessing

    import cv2

    _shared.update(stop=stop, counter=counter)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the parent, which sets the event
    cv2.setNumThreads(1)
    parent = multiprocessing.parent_process()

    def end_with_parent() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=end_with_parent, daemon=True).start()


def _do(work: Callable[[Item, WorkerControl], Answer], item: Item) -> Answer:
    def advance(more: int) -> None:
        with _shared["counter"].get_lock():
            _shared["counter"].value += more

    return work(item, WorkerControl(advance, _shared["stop"].is_set))
