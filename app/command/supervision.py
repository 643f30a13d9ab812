"""``serve`` in a process that may die: this one waits for it, and starts it again where it was.

A fault in compiled code, or a system that has no memory left, ends a whole process. So the
workbench is a child of a small process that imports nothing which could fault. Where a signal
ended the child that nobody sent on purpose, another one takes its port and its token, opens what
was open, and leaves out the run that was under way. Where a system cannot fork, ``serve`` is one
process.
"""

from __future__ import annotations

import os
import secrets
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from types import FrameType

from app.command.terminal import say

MOST_DEATHS = 4
"""Within :data:`DEATHS_SECONDS`; with more it is not started again."""

DEATHS_SECONDS = 60.0

ON_PURPOSE = ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT")
"""By which somebody ends a program; they are passed on."""

_PORT_LETTERS = 16


@dataclass(frozen=True, slots=True)
class Life:
    """One start of the workbench's process."""

    token: str
    """The same for all starts."""
    port: int | None
    """That the starts before had; None at the first."""
    ended: tuple[int, int] | None
    """Process and signal of the start before, which crashed."""
    line: socket.socket
    """To the process that waits."""

    def listens(self, port: int) -> None:
        """Say where, for the next start."""
        self.line.sendall(str(port).encode().ljust(_PORT_LETTERS))


life: Life | None = None
"""Of this process, where another one waits for it."""


def supervise(serve: Callable[[], int]) -> int:
    """Have something done in another process, and again where that crashes.

    Args:
        serve: What; called in another process, where this function returns its status too.

    Returns:
        The status.
    """
    if not hasattr(os, "fork") or threading.active_count() > 1:
        return serve()
    return _Waiting(serve).until_it_ends()


class _Waiting:
    """The process that waits."""

    def __init__(self, serve: Callable[[], int]) -> None:
        self._serve = serve
        self._process = 0
        self._asked = 0
        """The signal by which somebody wants it to end."""
        self._before = {
            number: signal.getsignal(number)
            for name in (*ON_PURPOSE, "SIGTSTP", "SIGCONT")
            if (number := getattr(signal, name, None)) is not None
        }

    def until_it_ends(self) -> int:
        token, port, ended = secrets.token_urlsafe(32), None, None
        deaths: list[float] = []
        for number, handler in self._before.items():
            if handler is not signal.SIG_IGN:  # as after nohup
                signal.signal(number, self._pass_on)
        while True:
            ours, theirs = socket.socketpair()
            for stream in (sys.stdout, sys.stderr):
                stream.flush()
            self._process = os.fork()
            if self._process == 0:
                ours.close()
                self._begin(Life(token, port, ended, theirs))
                return self._serve()
            theirs.close()
            if self._asked:  # before there was anybody to pass it on to
                os.kill(self._process, self._asked)
            _, status = os.waitpid(self._process, 0)
            code = os.waitstatus_to_exitcode(status)
            ended, self._process = (self._process, -code), 0
            port = _reported_port(ours) or port
            ours.close()
            if code >= 0:
                return code
            if self._asked or signal.Signals(-code).name in ON_PURPOSE:
                return self._end_by(-code)
            now = time.monotonic()
            deaths = [one for one in deaths if now - one < DEATHS_SECONDS] + [now]
            words = f"the workbench was ended by {name_of(-code)}"
            if port is None or len(deaths) > MOST_DEATHS:
                say(f"{words}; it is not started again")
                return 128 - code
            say(f"{words}; it is started again, without the run that was under way")

    def _begin(self, begun: Life) -> None:
        """In the child: signals as they were, and an end with whoever waits."""
        global life
        life = begun
        os.setpgid(0, 0)  # a terminal's Ctrl-C reaches the one that waits, which passes it on once
        for number, handler in self._before.items():
            signal.signal(number, handler if handler is not None else signal.SIG_DFL)
        with suppress(AttributeError):
            signal.signal(signal.SIGTTOU, signal.SIG_IGN)  # it may still write to the terminal

        def end_with_it() -> None:
            with suppress(OSError):
                begun.line.recv(1)
            os.kill(os.getpid(), signal.SIGKILL)

        threading.Thread(target=end_with_it, name="supervision", daemon=True).start()

    def _pass_on(self, number: int, frame: FrameType | None) -> None:
        name = signal.Signals(number).name
        if name in ON_PURPOSE:
            self._asked = number
        if self._process:
            with suppress(ProcessLookupError):
                os.kill(self._process, signal.SIGSTOP if name == "SIGTSTP" else number)
        if name == "SIGTSTP":
            os.kill(os.getpid(), signal.SIGSTOP)

    def _end_by(self, number: int) -> int:
        """As the child did."""
        with suppress(OSError, ValueError):
            signal.signal(number, signal.SIG_DFL)
        os.kill(os.getpid(), number)
        return 128 + number


def _reported_port(line: socket.socket) -> int | None:
    line.setblocking(False)
    with suppress(OSError, ValueError):
        return int(line.recv(_PORT_LETTERS))
    return None


def name_of(number: int) -> str:
    """A signal in words."""
    words = {"SIGSEGV": "segmentation fault", "SIGBUS": "bus error", "SIGFPE": "arithmetic fault",
             "SIGILL": "illegal instruction", "SIGABRT": "abort",
             "SIGKILL": "from outside, as a system does that has no memory left"}  # fmt: skip
    name = signal.Signals(number).name
    return f"{name} ({words[name]})" if name in words else name
