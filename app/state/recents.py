"""What was open last: kept for the next start, with a small picture of each."""

from __future__ import annotations

import hashlib
import logging
import os
import threading
import time
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path

from pydantic import FiniteFloat

from app.state.importing import small_jpeg
from app.state.snapshot import Change
from app.state.workbench import Workbench
from tracker.files.atomic import write_whole
from tracker.files.folders import cache_folder
from tracker.files.lock import locked
from tracker.files.validated import read_as, set_aside, write_json
from tracker.sequences import library
from tracker.sequences.built_in import built_in_name, opens_by_name
from tracker.sequences.errors import SequenceError
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.reader import FILE

logger = logging.getLogger("app")

KEPT = 24


@dataclass(frozen=True, slots=True)
class Recent:
    """A recording that was open."""

    name: str
    folder: str
    """Opens it again."""
    cameras: int
    frames: int
    fps: FiniteFloat
    opened: FiniteFloat
    """Seconds since 1970."""


class Recents:
    """Follows a workbench."""

    def __init__(self, workbench: Workbench, file: Path | None) -> None:
        """Read what was open before.

        Args:
            workbench: Whose recordings.
            file: Where they are kept; None: not beyond this start.
        """
        self._workbench = workbench
        self._file = file
        self._lock = threading.Lock()
        self._list = _read(file)
        self._unsubscribe = workbench.subscribe(self._on_change)

    def close(self) -> None:
        """Stop following."""
        self._unsubscribe()

    def all(self) -> list[Recent]:
        """Those that are still there, the last one first."""
        # of the module, for a method fails at a folder that may not be read any more
        return [one for one in self._list if os.path.isfile(Path(one.folder) / FILE)]

    def _on_change(self, change: Change) -> None:
        sequence = self._workbench.snapshot().sequence
        if change != "sequence" or sequence is None:
            return
        folder = sequence.folder.absolute()
        if opens_by_name(folder) and built_in_name(folder) is None:
            return  # rendered into the cache by an earlier version: nobody's recording
        one = Recent(
            sequence.name,
            str(folder),
            len(sequence.views),
            sequence.frames,
            sequence.fps,
            time.time(),
        )
        with self._lock:
            if self._file is None:
                self._list = _first(one, self._list)
                return
            try:
                with locked(self._file):  # of several workbenches none undoes what another noted
                    self._list = _first(one, _read(self._file) or self._list)
                    write_json(self._file, [asdict(own) for own in self._list])
            except OSError:
                self._list = _first(one, self._list)
                self._file = None  # it cannot be kept: nobody needs to hear of that twice


def _first(one: Recent, others: Iterable[Recent]) -> list[Recent]:
    return [one, *(other for other in others if other.folder != one.folder)][:KEPT]


def _read(file: Path | None) -> list[Recent]:
    try:
        return read_as(file, list[Recent]) if file is not None else []
    except OSError:  # none yet
        return []
    except ValueError as error:
        assert file is not None
        aside = set_aside(file)
        logger.warning("%s cannot be read and is now %s: %s", file, aside or file, error)
        return []


def thumbnail(folder: Path) -> bytes | None:
    """A small picture of a recording's first camera, as JPEG; made once.

    Returns:
        None where it has no pictures, or cannot be read.
    """
    try:
        changed = (folder / FILE).stat().st_mtime_ns
        key = hashlib.sha256(f"{folder} {changed}".encode()).hexdigest()[:24]
        place = cache_folder() / "thumbnails" / f"{key}.jpg"
        if place.is_file():
            return place.read_bytes() or None
        sequence = library.open_sequence(folder)
        with FrameReader(sequence) as reader:
            steps = (sequence.frames // 2, 0)
            found = (reader.picture(0, step) for step in steps)
            picture = next((one for one in found if one is not None), None)
        jpeg = None if picture is None else small_jpeg(picture)
        place.parent.mkdir(parents=True, exist_ok=True)
        write_whole(place, jpeg or b"")  # two tabs may ask at once
        return jpeg
    except (SequenceError, OSError):
        return None
