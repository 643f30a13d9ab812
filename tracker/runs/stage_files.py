"""Finished results of stage 1 on disk, of which the least recently used are deleted first.

Each is a folder of arrays with their checksums (:mod:`tracker.steps.files`), so that one that a
crash truncated or a disk damaged is recognised when it is read. A folder is written beside its
place and renamed when it is complete; of two processes that write the same one the first wins,
and both write the same. Its arrays are mapped, not read.
"""

from __future__ import annotations

import contextlib
import logging
import os
import shutil
import time
from pathlib import Path

from tracker.files.atomic import ABANDONED_SECONDS, beside, new_folder
from tracker.files.folders import cache_bytes
from tracker.single_view.protocol import ViewResult
from tracker.steps import Steps

logger = logging.getLogger(__name__)

_UNREADABLE = (OSError, ValueError, TypeError, KeyError, IndexError, EOFError)
"""What is raised for a folder that is not what was written."""

Views = Steps[tuple[ViewResult, ...]]
"""The results of stage 1 of each step, one for each camera."""


class StageFiles:
    """A folder of results of stage 1, by their cache key. Several processes may use it at once."""

    def __init__(self, folder: Path, limit_bytes: int | None = None) -> None:
        """Store the arguments; the folder is made when a result is written.

        Args:
            folder: The folder; everything in it belongs to the cache.
            limit_bytes: Largest size of all results together, from which on the least recently
                used are deleted; None for :func:`~tracker.files.folders.cache_bytes`.

        Raises:
            ValueError: If the limit in the environment is no size.
        """
        self._folder = folder
        self._limit = cache_bytes() if limit_bytes is None else limit_bytes

    def read(self, key: str, *, frames: int, cameras: int) -> Views | None:
        """Map the results of a finished stage 1; None if there are no usable files.

        Args:
            key: The cache key of the stage, a hash of sequence, parameters and code.
            frames: The number of steps that must be there.
            cameras: The number of results at each step.
        """
        path = self._folder / key
        try:
            found = Steps.read(path, ViewResult, frames=frames, width=cameras, key=key)
            with contextlib.suppress(OSError):  # a folder that is read-only is read as it is
                os.utime(path)  # marks it as used
        except (FileNotFoundError, NotADirectoryError):
            if not path.is_dir():
                return None
            logger.warning("%s lacks a file and is computed anew", path)
        except _UNREADABLE as error:
            logger.warning("%s cannot be used and is computed anew: %s", path, error)
        else:
            return found
        _remove(path)
        return None

    def write(self, key: str, views: Views) -> bool:
        """Write the results of a finished stage 1, and return whether they are now there.

        An error is logged and has no other effect, since a cache may always be empty.
        """
        path = self._folder / key
        if path.exists():
            return True
        if views.nbytes > self._limit:  # it would be deleted at once, and all others with it
            return False
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            with new_folder(path) as begun:
                views.write(begun, key)
        except OSError as error:
            if path.exists():  # by another process
                return True
            logger.warning("%s cannot be written: %s", path, error)
            return False
        self.prune()
        return True

    def prune(self) -> None:
        """Delete the least recently used results until the rest is within the limit."""
        now, found = time.time(), []
        for path in self._folder.glob("*"):
            with contextlib.suppress(OSError):  # another process prunes as well
                used = path.stat().st_mtime
                if not path.name.startswith("."):
                    size = sum(file.stat().st_size for file in (path, *path.glob("*")))
                    found.append((used, size, path))
                elif now - used > ABANDONED_SECONDS:
                    _remove(path)
        total = sum(size for _, size, _ in found)
        for _, size, path in sorted(found):
            if total <= self._limit:
                break
            _remove(path)
            total -= size


def _remove(path: Path) -> None:
    """Delete a file or folder at once, so that nobody finds a part of it."""
    with contextlib.suppress(OSError):
        gone = beside(path)
        path.replace(gone)
        if gone.is_dir():
            shutil.rmtree(gone, ignore_errors=True)
        else:
            gone.unlink()
