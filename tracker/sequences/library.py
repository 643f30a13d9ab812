"""Where sequences come from: the rendered rooms by name, any folder by its path."""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from tracker.folders import cache_folder
from tracker.sequences.fields import did_you_mean, listed
from tracker.sequences.reader import FILE, given_folder, read_sequence, read_summary
from tracker.sequences.sequence import DetectorFile, Sequence, SequenceError

DEFAULT_CAMERAS = 2
"""Cameras of a rendered room that is opened by its name."""

_RANDOM = re.compile(r"random-(\d{1,9})")
"""A random room by its seed."""

Told = Callable[[int, int], None]
"""Called with the steps rendered so far and their number."""


@dataclass(frozen=True, slots=True)
class SequenceEntry:
    """One line of the list of sequences."""

    name: str
    """What :func:`open_sequence` takes, or the folder's name under the data folder."""
    description: str
    kind: Literal["rendered", "folder"]
    cameras: int
    frames: int
    """0 where the file leaves it to its videos."""
    ready: bool
    """Whether it opens at once; a room that was never rendered does not."""
    folder: Path
    """Where it is, or will be once it is rendered."""
    error: str | None = None
    """Why it cannot be opened, in one sentence."""


def available(data: Path | None = None) -> list[SequenceEntry]:
    """The rendered rooms, those of seeds that were rendered, then the folders under ``data``.

    Only heads of files are read: what else is wrong with a folder shows on opening it.
    """
    from tracker.sequences.rendering import ROOMS  # imports the renderer only where it is needed

    entries = [
        SequenceEntry(
            name=name,
            description=room.description,
            kind="rendered",
            cameras=DEFAULT_CAMERAS,
            frames=room.frames,
            ready=(rendered_folder(name) / FILE).is_file(),
            folder=rendered_folder(name),
        )
        for name, room in ROOMS.items()
    ]
    entries += [_entry(folder, "rendered") for folder in _folders(_random_rooms())]
    if data is not None and data.is_dir():
        entries += [_entry(folder) for folder in _folders(data)]
    return entries


def _folders(data: Path) -> list[Path]:
    """Folders with a sequence's file, also where some of them may not be looked into."""
    try:
        with os.scandir(data) as inside:
            names = sorted(entry.name for entry in inside if not entry.name.startswith("."))
    except OSError:
        return []
    return [data / name for name in names if os.path.lexists(data / name / FILE)]


def _entry(folder: Path, kind: Literal["rendered", "folder"] = "folder") -> SequenceEntry:
    description, cameras, frames, error = "", 0, 0, None
    try:
        summary = read_summary(folder)
        description, cameras = summary.description, summary.cameras
        frames = summary.frames or 0
    except (ValueError, OSError, RecursionError, MemoryError) as problem:
        # whatever is wrong with one folder is a line of the list, and the others stay in it
        error = " ".join(str(problem).split()) or type(problem).__name__
    return SequenceEntry(
        name=folder.name,
        description=description,
        kind=kind,
        cameras=cameras,
        frames=frames,
        ready=error is None,
        folder=folder,
        error=error,
    )


def rendered_folder(name: str, cameras: int = DEFAULT_CAMERAS) -> Path:
    """Where a rendered room is kept; another version of the renderer has another place."""
    return _rooms() / f"{name}-{cameras}-cameras"


def _rooms() -> Path:
    from tracker.sequences.rendering import VERSION

    return cache_folder() / "rooms" / f"version-{VERSION}"


def _random_rooms() -> Path:
    """Where those of seeds are."""
    return _rooms() / "random"


def is_room(name: str) -> bool:
    """Whether a name is that of a rendered room: a built-in one, or ``random-SEED``."""
    from tracker.sequences.rendering import ROOMS

    return name in ROOMS or _RANDOM.fullmatch(name) is not None


def next_random(entries: list[SequenceEntry]) -> str:
    """The name of a random room that was not rendered yet."""
    seeds = [int(match[1]) for one in entries if (match := _RANDOM.fullmatch(one.name))]
    return f"random-{max(seeds, default=0) + 1}"


def open_sequence(
    name_or_folder: str | Path,
    *,
    progress: Told | None = None,
    cancelled: Callable[[], bool] | None = None,
    cameras: int = DEFAULT_CAMERAS,
) -> Sequence:
    """Open a rendered room by its name, or a sequence folder.

    A room that is not in the cache yet is rendered into it first. A folder of the same
    name as a room is opened by a path with a separator, for instance ``./room44-3p``.

    Args:
        name_or_folder: Name of a room, ``random-SEED`` for a room of any kind, or path of a folder.
        progress: Called while rendering.
        cancelled: Asked while rendering.
        cameras: Of a rendered room.

    Raises:
        SequenceError: If there is no such sequence, or it cannot be read.
        OSError: If a room cannot be written to the cache.
    """
    from tracker.sequences.rendering import ROOMS

    name = str(name_or_folder)
    if is_room(name):
        return _open_room(name, progress, cancelled, cameras)
    folder = given_folder(name_or_folder)
    if not folder.exists() and len(folder.parts) <= 1:
        hint = did_you_mean(name, ROOMS)
        raise SequenceError(
            f'there is no sequence "{name}": expected one of the rendered rooms '
            f"{listed([*ROOMS, 'random-SEED'])}, or the path of a folder with a {FILE}{hint}"
        )
    return read_sequence(folder)


def with_detector(sequence: Sequence, path: Path | None) -> Sequence:
    """The sequence with a detection network that may be run on its pictures.

    Args:
        sequence: Any.
        path: An ONNX file; None leaves the sequence as it is.

    Raises:
        SequenceError: If the file cannot be read.
    """
    if path is None:
        return sequence
    try:
        with path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()[:16]
    except OSError as error:
        raise SequenceError(
            f"the detector {path} cannot be read ({error.strerror}); name an ONNX file"
        ) from error
    return replace(sequence, detector=DetectorFile(path, digest))


def _open_room(
    name: str, progress: Told | None, cancelled: Callable[[], bool] | None, cameras: int
) -> Sequence:
    from tracker.sequences.rendering import render, render_random
    from tracker.sequences.rendering.writing import is_whole

    random = _RANDOM.fullmatch(name)
    folder = _random_rooms() / name if random else rendered_folder(name, cameras)
    if is_whole(folder):
        with contextlib.suppress(SequenceError):
            return read_sequence(folder)
    if folder.exists():  # somebody spoilt it; it can always be rendered again
        shutil.rmtree(folder)
    folder.parent.mkdir(parents=True, exist_ok=True)
    if random:
        render_random(
            int(random[1]), folder, detections=True, progress=progress, cancelled=cancelled
        )
    else:
        render(name, folder, cameras=cameras, progress=progress, cancelled=cancelled)
    return read_sequence(folder)
