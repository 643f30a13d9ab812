"""Fetches a detection network in a thread of its own, once a person asks for it."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable

from app.errors import sentence
from app.state.workbench import Workbench
from app.state.workers.threads import CLOSING_SECONDS, be_nice

logger = logging.getLogger("app")


class DetectorFetching:
    """At most one fetching at a time, whose progress is part of the workbench's state."""

    def __init__(self, workbench: Workbench, take_up: Callable[[], object]) -> None:
        """Fetch nothing yet.

        Args:
            workbench: Shows the progress, and says how it ended.
            take_up: Opens what is open again, with the network at hand: the method is the one that
                then fits, which with marked people is still the one by their colours.
        """
        self._workbench = workbench
        self._take_up = take_up
        self._lock = threading.Lock()
        self._cancelled = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Begin to fetch, unless that is under way."""
        with self._lock:
            if self._thread is not None and self._thread.is_alive():
                return
            self._cancelled = threading.Event()
            self._workbench.show_fetching(0)
            self._thread = threading.Thread(
                target=self._fetch, args=(self._cancelled,), name="fetching", daemon=True
            )
            self._thread.start()

    def cancel(self) -> None:
        """Stop what is under way; nothing of it is kept."""
        with self._lock:
            self._cancelled.set()
            thread = self._thread
        if thread is not None:
            thread.join(timeout=CLOSING_SECONDS)

    def close(self) -> None:
        """Stop, at the end of the program."""
        self.cancel()

    def _fetch(self, cancelled: threading.Event) -> None:
        from tracker.single_view.onnx import fetching  # at its first use

        be_nice()

        def progress(done: int, total: int) -> None:
            self._workbench.show_fetching(100 * done // max(total, 1))

        try:
            found = fetching.fetch(fetching.NANODET, progress, cancelled.is_set)
        except fetching.FetchCancelled:
            self._workbench.show_fetching(None)
        except Exception as error:
            if not isinstance(error, ValueError | OSError):
                logger.exception("fetching a detector failed")
            self._workbench.show_fetching(None)
            words = sentence(error)
            self._workbench.notify("error", f"No detector was fetched: {words}")
        else:
            self._workbench.show_fetching(None)
            self._workbench.notify("info", f"The detector {found.name} is at hand.")
            if not cancelled.is_set() and self._workbench.snapshot().sequence is not None:
                self._take_up()
