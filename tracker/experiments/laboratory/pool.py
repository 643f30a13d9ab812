"""One process a seed: work spread over the cores, with progress, that ends when it is told to."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass
from typing import Any, TypeVar

from tracker.experiments.laboratory.experiment import Context
from tracker.pipeline import Cancelled

Item = TypeVar("Item")
Answer = TypeVar("Answer")

SECONDS_BETWEEN = 0.1
"""How often progress is told and the wish to stop is heard."""


@dataclass(frozen=True, slots=True)
class Desk:
    """What a worker process is given: where to report progress, and whether to stop."""

    advance: Callable[[int], None]
    """Called with the number of steps done since the last call."""
    cancelled: Callable[[], bool]


_own: dict[str, Any] = {}
"""Of a worker's process: the counter and the wish to stop that it shares with the others."""


def cores() -> int:
    """Cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def spread(
    work: Callable[[Item, Desk], Answer],
    items: Sequence[Item],
    context: Context,
    *,
    words: str,
    steps: int,
) -> list[Answer]:
    """Do a piece of work for every item, several at a time; the answers in the items' order.

    Args:
        work: A function of a module, so that another process finds it.
        items: Values that can be sent to another process.
        context: How many at a time; whom to tell; whom to ask.
        words: What is being done.
        steps: What all the work's advances sum to.

    Raises:
        Cancelled: If the context said so.
    """
    context.told(words, 0, steps)
    if min(context.processes, len(items)) <= 1:
        return [work(item, _desk_here(context, words, index, steps, len(items)))
                for index, item in enumerate(items)]  # fmt: skip
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor

    spawn = multiprocessing.get_context("spawn")  # a fork would copy threads' locks as they are
    stop, counter = spawn.Event(), spawn.Value("q", 0)
    pool = ProcessPoolExecutor(
        min(context.processes, len(items)),
        mp_context=spawn,
        initializer=_begin,
        initargs=(stop, counter),
    )
    futures: list[Future[Answer]] = []
    try:
        futures += [pool.submit(_do, work, item) for item in items]
        pending = set(futures)
        while pending:
            done, pending = wait(pending, SECONDS_BETWEEN, FIRST_COMPLETED)
            for future in done:
                future.result()  # a failure ends all
            context.told(words, min(counter.value, steps), steps)
            if context.cancelled():
                raise Cancelled
    finally:
        stop.set()
        pool.shutdown(wait=True, cancel_futures=True)
    context.told(words, steps, steps)
    return [future.result() for future in futures]


def _desk_here(context: Context, words: str, index: int, steps: int, count: int) -> Desk:
    done = index * steps // count

    def advance(more: int) -> None:
        nonlocal done
        done += more
        context.told(words, min(done, steps), steps)

    return Desk(advance, context.cancelled)


def _begin(stop: Any, counter: Any) -> None:
    """A worker's process begins."""
    import multiprocessing

    import cv2

    _own.update(stop=stop, counter=counter)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the parent, which tells us
    cv2.setNumThreads(1)
    parent = multiprocessing.parent_process()

    def end_with_parent() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=end_with_parent, daemon=True).start()


def _do(work: Callable[[Item, Desk], Answer], item: Item) -> Answer:
    def advance(more: int) -> None:
        with _own["counter"].get_lock():
            _own["counter"].value += more

    return work(item, Desk(advance, _own["stop"].is_set))
