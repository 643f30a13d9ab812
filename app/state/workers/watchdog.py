"""Tells when a piece of work has said nothing for long: it goes on, but somebody should know."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

SILENT_SECONDS = 20.0
"""Longer than any step takes, and than learning a background of most recordings."""

_LOOKS_SECONDS = 2.0


class Watchdog:
    """Within it, work must call :meth:`heard` now and then."""

    def __init__(
        self,
        told: Callable[[float], None],
        *,
        after: float = SILENT_SECONDS,
        looks: float = _LOOKS_SECONDS,
    ) -> None:
        """Nothing runs before it is entered.

        Args:
            told: Called with the seconds of silence, from a thread of its own, while it lasts.
            after: Seconds from which on it is called.
            looks: Seconds between two looks.
        """
        self._told = told
        self._after = after
        self._looks = looks
        self._last = 0.0
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="watchdog", daemon=True)

    def __enter__(self) -> Watchdog:
        self._last = time.monotonic()
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()

    def heard(self) -> None:
        """The work goes on."""
        self._last = time.monotonic()

    def _watch(self) -> None:
        while not self._ended.wait(self._looks):
            silent = time.monotonic() - self._last
            if silent >= self._after:
                self._told(silent)
