"""A thread that does the newest of what it was asked for, and what follows the workbench by it."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Set

from app.state.snapshot import Change
from app.state.workbench import Workbench

logger = logging.getLogger(__name__)


class LatestWorker:
    """Calls a function with all topics asked for since its last call, in a thread of its own.

    Asking returns at once, from any thread. However often a topic is asked for
    while the function is at work, it is handed over once, so the newest state
    is what gets done and nothing queues up.
    """

    def __init__(
        self,
        name: str,
        work: Callable[[Set[str]], None],
    ) -> None:
        """Start the thread.

        Args:
            name: Of the thread, for logs and debuggers.
            work: Gets the topics; always called from the worker's thread. After an exception of
                it, which is logged, the worker goes on with the next topic.
        """
        self._work = work
        self._changed = threading.Condition()
        self._topics: set[str] = set()
        self._busy = False
        self._closed = False
        self._failure: Exception | None = None
        self._thread = threading.Thread(target=self._loop, name=name, daemon=True)
        self._thread.start()

    def ask(self, *topics: str) -> None:
        """Have the topics done soon; does nothing after :meth:`close`."""
        with self._changed:
            if not self._closed:
                self._topics.update(topics)
                self._changed.notify_all()

    def wait(self, timeout: float) -> bool:
        """Block until nothing is left to do.

        Returns:
            Whether that was reached within ``timeout`` seconds.

        Raises:
            Exception: The failure of ``work`` since the last call, if there was one.
        """
        end = time.monotonic() + timeout
        with self._changed:
            while self._topics or self._busy:
                left = end - time.monotonic()
                if left <= 0.0:
                    return False
                self._changed.wait(left)
            failure, self._failure = self._failure, None
        if failure is not None:
            raise failure
        return True

    def close(self) -> None:
        """Drop what was not begun and end the thread. May be called twice, or from ``work``."""
        with self._changed:
            self._closed = True
            self._topics.clear()
            self._changed.notify_all()
        if threading.current_thread() is not self._thread:
            self._thread.join()

    def _loop(self) -> None:
        while True:
            with self._changed:
                while not self._topics and not self._closed:
                    self._changed.wait()
                if self._closed:
                    return
                topics, self._topics = frozenset(self._topics), set()
                self._busy = True
            try:
                self._work(topics)
            except Exception as failure:
                logger.exception("%s: %s failed", self._thread.name, ", ".join(sorted(topics)))
                self._failure = failure
            finally:
                with self._changed:
                    self._busy = False
                    self._changed.notify_all()


class Follower:
    """A part of the 3D view that is kept equal to the workbench by a thread of its own."""

    def __init__(self, name: str, workbench: Workbench) -> None:
        """Start the thread, which is asked for nothing yet."""
        self._workbench = workbench
        self._worker = LatestWorker(name, self._work)
        self._unsubscribe: Callable[[], None] = lambda: None

    def follow(self) -> None:
        """Follow the workbench from now on, and show first what it has already."""
        self._unsubscribe = self._workbench.subscribe(self._note)
        self._worker.ask("sequence")

    def wait(self, timeout: float) -> bool:
        """Block until all that was asked for is done; whether it was within ``timeout`` seconds.

        Raises:
            Exception: What went wrong meanwhile.
        """
        return self._worker.wait(timeout)

    def close(self) -> None:
        """Stop following; what is in the view stays as it is."""
        self._unsubscribe()
        self._worker.close()

    def _note(self, change: Change) -> None:
        """Ask the worker for what a change concerns; this returns at once."""
        raise NotImplementedError

    def _work(self, topics: Set[str]) -> None:
        """Do what was asked for, in the worker's thread."""
        raise NotImplementedError
