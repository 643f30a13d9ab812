"""Compilation of the kernels beside the program, where that was not yet done on this machine."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable

from tracker.kernels import compilation
from tracker.runs import warm_up
from tracker.runs.warm_up import COMPILING

logger = logging.getLogger("app")

_LOOKS_SECONDS = 0.1

_ENDING_SECONDS = 5.0
"""How long the processes that compile are waited for at the end."""


class Compiling:
    """Compiles beside the program, whose interpreter stays free; what is ready is on disk.

    The first run waits for the loops over pixels only. Until the others are there they run as
    plain Python, slower and with the same numbers.
    """

    def __init__(self, say: Callable[[str], None] = lambda words: None) -> None:
        """Begin, if there is anything to compile.

        Args:
            say: Gets a sentence once a run has to wait for it, and then one at its end.
        """
        self._say, self._waited_for = say, False
        self._ready, self._stopped = threading.Event(), threading.Event()
        self._counts = 0, 0
        self._thread = threading.Thread(target=self._compile, name="compiling", daemon=True)
        if compilation.is_compiled():
            self._ready.set()
            return
        compilation.while_compiling()
        if compilation.are_pixels_compiled():
            self._ready.set()
        self._thread.start()

    @property
    def words(self) -> str:
        """What is said while kernels are compiled, with their number; empty once all are there."""
        if not self._thread.is_alive():
            return ""
        done, total = self._counts
        return f"{COMPILING}, {done} of {total}" if total else COMPILING

    def wait(self, told: Callable[[str], None], cancelled: Callable[[], bool]) -> None:
        """Until a run can begin.

        Args:
            told: Called now and then with :attr:`words`.
            cancelled: Asked as often.
        """
        while not cancelled() and not self._ready.wait(_LOOKS_SECONDS):
            if not self._waited_for:
                self._waited_for = True
                self._say(COMPILING)
            told(self.words)

    def stop(self) -> None:
        """End the processes; what was compiled stays.

        A run that is under way goes on as plain Python: to compile what is still missing would
        keep it, and with it the program, for a minute.
        """
        self._stopped.set()
        self._ready.set()
        if self._thread.is_alive():
            self._thread.join(_ENDING_SECONDS)

    def close(self) -> None:
        """Stop; from now on each kernel is compiled where it is first needed."""
        self.stop()
        compilation.no_longer_compiling()

    def _compile(self) -> None:
        try:
            status = warm_up.ensure_compiled(
                progress=self._progress,
                ready=self._ready.set,
                stopped=self._stopped.is_set,
                background=True,
            )
        except OSError as error:  # each kernel is then compiled where it is first needed
            logger.warning("the kernels are compiled when they are needed: %s", error)
        else:
            if status == 0:
                if self._waited_for:
                    self._say("the kernels are compiled")
            elif not self._stopped.is_set():
                logger.warning("compiling ended with status %s", status)
        if not self._stopped.is_set():
            compilation.no_longer_compiling()
        self._ready.set()

    def _progress(self, done: int, total: int) -> None:
        self._counts = done, total
