"""Finished columns of stage 1 on disk: whole files only, the oldest leave first.

A file is an uncompressed NumPy archive: every array carries a checksum and its index
stands at the end, so what a crash cut short, or a disk spoilt, is found out when it is
read. A file is written beside its place and moved there when it is complete; of two
processes that write the same one the later wins, and both wrote the same.
"""

from __future__ import annotations

import contextlib
import json
import logging
import os
import tempfile
import time
import zipfile
import zlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.lib.npyio import NpzFile

from tracker.files.atomic import sync_folder
from tracker.runs.columns import pack, unpack
from tracker.single_view.protocol import ViewResult

logger = logging.getLogger(__name__)

FORMAT = 1
"""Of the files; what another version wrote is not read."""

LIMIT_BYTES = 2 << 30
"""Disk space for all columns together."""

ABANDONED_SECONDS = 3600.0
"""A file that was begun and not written to for so many seconds was left by a process that died."""

_UNREADABLE = (
    OSError, ValueError, KeyError, EOFError, NotImplementedError, RuntimeError,
    zipfile.BadZipFile, zlib.error,
)  # fmt: skip
"""What the standard library raises of an archive that is none, or of a spoilt one."""

_HEAD = "head"
_BEGUN = ".part"

Views = list[tuple[ViewResult, ...]]
"""Stage 1 of each step, one result a camera."""


class StageFiles:
    """A folder of columns, by the keys of their stage. Any number of processes may use it."""

    def __init__(self, folder: Path, limit_bytes: int = LIMIT_BYTES) -> None:
        """Nothing is made or read before it is needed.

        Args:
            folder: Where; its files named ``*.npz`` and ``*.part`` belong to this.
            limit_bytes: Bound on the space of the columns; those not used for longest go.
        """
        self._folder = folder
        self._limit = limit_bytes

    def read(self, key: str, *, frames: int, cameras: int) -> Views | None:
        """A finished column, or None where there is none that can be used.

        Args:
            key: Of the stage: sequence, parameters and version of the numbers.
            frames: The number of steps it must have.
            cameras: The number of results a step.
        """
        path = self._path(key)
        try:
            with (
                path.open("rb") as file,
                zipfile.ZipFile(file) as checked,
                NpzFile(file, allow_pickle=False) as archive,
            ):
                if (spoilt := checked.testzip()) is not None:
                    raise ValueError(f"{spoilt} is not what was written")
                head = json.loads(archive[_HEAD].tobytes())
                if head != _head(key, frames, cameras):
                    raise ValueError(f"expected {_head(key, frames, cameras)}, found {head}")
                columns = []
                for camera in range(cameras):
                    begin = f"{camera}/"
                    names = [name for name in archive.files if name.startswith(begin)]
                    arrays = {name.removeprefix(begin): archive[name] for name in names}
                    columns.append(unpack(arrays, ViewResult))
                    if len(columns[-1]) != frames:
                        raise ValueError(f"expected {frames} steps, found {len(columns[-1])}")
            os.utime(path)  # it was used
        except (FileNotFoundError, NotADirectoryError):
            return None
        except _UNREADABLE as error:
            logger.warning("%s cannot be used and is computed anew: %s", path, error)
            with contextlib.suppress(OSError):
                path.unlink()
            return None
        return list(zip(*columns, strict=True))

    def write(self, key: str, views: Sequence[tuple[ViewResult, ...]]) -> bool:
        """Keep a finished column; whether it is there now.

        What cannot be written is told to the log and otherwise without effect: a cache
        may always be empty.
        """
        path = self._path(key)
        if path.exists():
            return True
        cameras = len(views[0]) if views else 0
        arrays = {_HEAD: _text(json.dumps(_head(key, len(views), cameras)))}
        for camera in range(cameras):
            packed = pack([step[camera] for step in views], ViewResult)
            arrays |= {f"{camera}/{name}": array for name, array in packed.items()}
        begun = None
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            descriptor, begun = tempfile.mkstemp(dir=self._folder, prefix=key, suffix=_BEGUN)
            with os.fdopen(descriptor, "wb") as file:
                np.savez(file, allow_pickle=False, **arrays)
                file.flush()
                os.fsync(file.fileno())
            os.replace(begun, path)
            sync_folder(self._folder)
        except OSError as error:
            logger.warning("%s cannot be written: %s", path, error)
            if begun is not None:
                with contextlib.suppress(OSError):
                    os.unlink(begun)
            return False
        self.prune()
        return True

    def prune(self) -> None:
        """Delete what was used least recently, until the rest is within the limit."""
        now, found = time.time(), []
        for path in self._folder.glob("*"):
            with contextlib.suppress(OSError):  # another process prunes as well
                status = path.stat()
                if path.suffix == ".npz":
                    found.append((status.st_mtime, status.st_size, path))
                elif path.suffix == _BEGUN and now - status.st_mtime > ABANDONED_SECONDS:
                    path.unlink()
        total = sum(size for _, size, _ in found)
        for _, size, path in sorted(found):
            if total <= self._limit:
                break
            with contextlib.suppress(OSError):
                path.unlink()
            total -= size

    def _path(self, key: str) -> Path:
        return self._folder / f"{key}.npz"


def _head(key: str, frames: int, cameras: int) -> dict[str, object]:
    return {"format": FORMAT, "key": key, "frames": frames, "cameras": cameras}


def _text(text: str) -> np.ndarray:
    return np.frombuffer(text.encode(), dtype=np.uint8)
