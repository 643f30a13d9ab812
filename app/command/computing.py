"""Ctrl-C in the middle of compiled code: noted where it falls, raised between two steps."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from types import FrameType
from typing import TYPE_CHECKING

from app.command.terminal import Bar, say

if TYPE_CHECKING:
    from tracker.corrections import Correction
    from tracker.parameters import Stage
    from tracker.parameters.catalogue import RunParameters
    from tracker.runs.pipeline import Progress, Run
    from tracker.sequences.sequence import Sequence


@contextmanager
def between_steps() -> Iterator[Callable[[], bool]]:
    """Within it the first Ctrl-C is only noted; what is yielded says whether it came.

    Python raises KeyboardInterrupt wherever the main thread is. In the middle of a compiled
    kernel, whose callers do not expect an exception, that could crash the program. Work that asks
    between its steps ends as soon, and tidily. A second Ctrl-C is raised at once.

    Raises:
        KeyboardInterrupt: At the end, if Ctrl-C came; in the place of what the work raised then.
    """
    heard = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield heard.is_set  # signals are the main thread's
        return

    def note(number: int, frame: FrameType | None) -> None:
        if heard.is_set():
            signal.default_int_handler(number, frame)
        heard.set()

    before = signal.signal(signal.SIGINT, note)
    try:
        yield heard.is_set
    except Exception:
        if not heard.is_set():
            raise
    finally:
        signal.signal(signal.SIGINT, before)
    if heard.is_set():
        raise KeyboardInterrupt


def compute(
    sequence: Sequence,
    parameters: RunParameters | None = None,
    *,
    seed: int = 0,
    corrections: tuple[Correction, ...] = (),
    cached: bool = True,
    words: str = "tracking",
    stages: set[Stage] | None = None,
) -> Run:
    """Compute a run under a progress bar, once its kernels are compiled.

    Args:
        sequence: The sequence to track.
        parameters: The parameters; None for those that fit the sequence.
        seed: The seed of all randomness.
        corrections: The corrections that the run obeys.
        cached: Whether results of earlier runs are taken up, and new ones stored.
        words: The words before the bar.
        stages: Gets every stage that is computed.

    Raises:
        KeyboardInterrupt: After Ctrl-C, between two steps.
    """
    from app.state.compiling import Compiling
    from tracker.runs import pipeline
    from tracker.runs.stage_cache import StageCache

    def report(_: Run, progress: Progress) -> None:
        if stages is not None:
            stages.add(progress.stage)
        bar.at(progress.done, progress.total)

    with (
        Bar(words, "step") as bar,
        closing(Compiling(say)) as compiling,
        between_steps() as interrupted,
    ):
        bar.at(0, sequence.frames)
        compiling.wait(lambda words: None, interrupted)
        return pipeline.compute(
            sequence,
            parameters or pipeline.default_parameters(sequence),
            seed=seed,
            corrections=corrections,
            cache=StageCache.on_disk() if cached else None,
            on_progress=report,
            cancelled=interrupted,
        )
