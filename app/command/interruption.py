"""Ctrl-C in the middle of compiled code: noted where it falls, raised between two steps."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType


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
