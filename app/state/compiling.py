"""The process that compiles the kernels, where that was not yet done on this machine."""

from __future__ import annotations

import logging
import subprocess
import sys
import threading
from collections.abc import Callable
from typing import Literal

from tracker.kernels import compilation

logger = logging.getLogger("app")

WORDS = "compiling the kernels, once per machine"

_LOOKS_SECONDS = 0.1


class Compiling:
    """Compiles beside the server, whose interpreter stays free; what is ready is on disk.

    What a sequence needs to be seen comes first, a few seconds, then the methods that
    sequences start with: pictures and room are there before the first run can begin. The
    other methods' kernels are compiled meanwhile.
    """

    def __init__(self, say: Callable[[str], None] = lambda words: None) -> None:
        """Begin, if there is anything to compile.

        Args:
            say: Told of its beginning and its end.
        """
        self._say = say
        self._ready = {"shown": threading.Event(), "ready": threading.Event()}
        self._counts = (0, 0)
        self._process: subprocess.Popen[str] | None = None
        if compilation.is_compiled():
            self._release()
            return
        say(WORDS)
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "tracker.warm_up"],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
            )
        except OSError as error:  # each kernel is then compiled where it is first needed
            logger.warning("the kernels are compiled when they are needed: %s", error)
            self._release()
            return
        threading.Thread(target=self._read, name="compiling", daemon=True).start()

    def wait(
        self,
        what: Literal["shown", "ready"],
        told: Callable[[int, int], None],
        cancelled: Callable[[], bool],
    ) -> None:
        """Until the kernels are there that something needs.

        Args:
            what: To be shown without a run, or to be run with the first methods.
            told: Called now and then with the number of kernels that are ready and of all.
            cancelled: Asked as often.
        """
        while not cancelled() and not self._ready[what].wait(_LOOKS_SECONDS):
            told(*self._counts)

    def close(self) -> None:
        """Stop; what was compiled stays."""
        self._release()
        if self._process is not None:
            self._process.terminate()

    def _release(self) -> None:
        for event in self._ready.values():
            event.set()

    def _read(self) -> None:
        process = self._process
        assert process is not None
        assert process.stdout is not None
        with process.stdout:
            for line in process.stdout:
                words = line.split()
                if len(words) == 1 and words[0] in self._ready:
                    self._ready[words[0]].set()
                elif len(words) == 2:
                    self._counts = int(words[0]), int(words[1])
        if process.wait() == 0:
            self._say("the kernels are compiled")
        elif not self._ready["ready"].is_set():
            logger.warning("compiling ended with status %s", process.returncode)
        self._release()
