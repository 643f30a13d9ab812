"""The processes that compile the kernels, where that was not yet done on this machine."""

from __future__ import annotations

import logging
import subprocess
import threading
from collections.abc import Callable

from tracker.kernels import compilation
from tracker.runs import warm_up

logger = logging.getLogger("app")

WORDS = "compiling the kernels, once per machine"

_LOOKS_SECONDS = 0.1


class Compiling:
    """Compiles beside the program, whose interpreter stays free; what is ready is on disk.

    The first run waits for the loops over pixels only. Until the others are there they run as
    plain Python, slower and with the same numbers.
    """

    def __init__(self, say: Callable[[str], None] = lambda words: None) -> None:
        """Begin, if there is anything to compile.

        Args:
            say: Told of its beginning and its end.
        """
        self._say = say
        self._ready = threading.Event()
        self._counts: dict[str, tuple[int, int]] = {}
        self._processes: dict[str, subprocess.Popen[str]] = {}
        self._closed = False
        if compilation.is_compiled():
            self._ready.set()
            return
        say(WORDS)
        try:
            for half in warm_up.HALVES:
                self._processes[half] = warm_up.start(
                    half, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
                )
        except OSError as error:  # each kernel is then compiled where it is first needed
            logger.warning("the kernels are compiled when they are needed: %s", error)
            self.close()
            return
        compilation.while_compiling()
        threading.Thread(target=self._follow, name="compiling", daemon=True).start()

    def wait(self, told: Callable[[int, int], None], cancelled: Callable[[], bool]) -> None:
        """Until a run can begin.

        Args:
            told: Called now and then with the number of kernels that are ready and of all.
            cancelled: Asked as often.
        """
        while not cancelled() and not self._ready.wait(_LOOKS_SECONDS):
            told(*max(self._counts.values(), default=(0, 0)))

    def stop(self) -> None:
        """End the processes; what was compiled stays.

        A run that is under way goes on as plain Python: to compile what is still missing would
        keep it, and with it the program, for a minute.
        """
        self._closed = True
        self._ready.set()
        for process in self._processes.values():
            process.terminate()

    def close(self) -> None:
        """Stop; from now on each kernel is compiled where it is first needed."""
        self.stop()
        compilation.no_longer_compiling()

    def _follow(self) -> None:
        readers = [
            threading.Thread(target=self._read, args=each, name=f"compiling {each[0]}", daemon=True)
            for each in self._processes.items()
        ]
        for reader in readers:
            reader.start()
        for reader in readers:
            reader.join()
        statuses = [process.wait() for process in self._processes.values()]
        if not any(statuses):
            compilation.mark_compiled()
            self._say("the kernels are compiled")
        elif not self._closed:
            logger.warning("compiling ended with status %s", max(statuses, key=abs))
        if not self._closed:
            compilation.no_longer_compiling()
        self._ready.set()

    def _read(self, half: str, process: subprocess.Popen[str]) -> None:
        assert process.stdout is not None
        with process.stdout:
            for line in process.stdout:
                words = line.split()
                if words == ["ready"]:
                    self._ready.set()
                elif len(words) == 2:
                    self._counts[half] = int(words[0]), int(words[1])
                    compilation.news_of_compiling()
        if process.wait() != 0:  # it will not say that it is ready
            self._ready.set()
