"""How threads that work in the background yield to whoever looks, and how they end."""

from __future__ import annotations

import contextlib
import os
import sys
import threading
from collections.abc import Callable

NICENESS = 2
"""Priority (Unix niceness) of the threads that work on pictures: the operating system runs them
when the server is idle, so that scrubbing stays fluent. The fusion keeps the usual one: it is
short, and whoever moves a slider waits for it."""

CLOSING_SECONDS = 1.0
"""How long what is under way may take to notice that it is to end."""


def in_background(work: Callable[[], object]) -> None:
    """Run something in a daemon thread of low priority; the end of the program may cut it short."""

    def nicely() -> None:
        be_nice()
        work()

    threading.Thread(target=nicely, name="stage-files", daemon=True).start()


def be_nice() -> None:
    """Lower the priority of this thread and of those it starts, where the system lets threads."""
    set_priority: Callable[[int, int, int], None] | None = getattr(os, "setpriority", None)
    if set_priority is not None and sys.platform.startswith("linux"):
        with contextlib.suppress(OSError):
            set_priority(os.PRIO_PROCESS, threading.get_native_id(), NICENESS)
