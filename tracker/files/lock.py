"""A lock that the system frees when the process that holds it ends, however it ends."""

from __future__ import annotations

import errno
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

SECONDS_BETWEEN = 0.1
"""Interval between two attempts to take a lock that another holder has, seconds."""

_HELD = (errno.EACCES, errno.EAGAIN, errno.EDEADLK)
"""The errors by which the system says that another holder has the lock."""


@contextmanager
def locked(path: Path, *, wait: Callable[[], bool] | None = None) -> Iterator[bool]:
    """Let one holder at a time run the block, among all processes and threads of the machine.

    The lock is on a file beside the path, which is never deleted. On a file system without locks
    it is always free.

    Args:
        path: What the lock protects; it need not exist.
        wait: A function that is called at intervals while another holder has the lock, and that
            returns False to give up; None to wait as long as it takes.

    Yields:
        Whether the lock is held; False if ``wait`` gave up.

    Raises:
        OSError: If the file of the lock cannot be made.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with _lock_of(path).open("ab") as file:
        if wait is None and sys.platform != "win32":
            held = _take(file, fcntl.LOCK_EX)
        else:
            while not (held := _take(file)) and (wait is None or wait()):
                time.sleep(SECONDS_BETWEEN)
        yield held


def is_locked(path: Path) -> bool:
    """Return whether some holder has the lock of a path; the file of the lock is not made."""
    try:
        with _lock_of(path).open("rb") as file:
            shared = None if sys.platform == "win32" else fcntl.LOCK_SH | fcntl.LOCK_NB
            return not _take(file, shared)  # those who ask at the same time do not see each other
    except OSError:
        return False


def _lock_of(path: Path) -> Path:
    """Return the file of the lock of a path."""
    return path.with_name(f".{path.name}.lock")


def _take(file: IO[bytes], how: int | None = None) -> bool:
    """Try to lock an open file until it is closed; False if another holder has the lock.

    Args:
        file: The open file.
        how: The operation of ``flock``; None for an exclusive lock without waiting.
    """
    try:
        if sys.platform == "win32":
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        else:
            fcntl.flock(file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB if how is None else how)
    except OSError as error:
        return error.errno not in _HELD
    return True
