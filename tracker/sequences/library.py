"""Where sequences come from: the built-in rooms by name, any folder by its path."""

from __future__ import annotations

import hashlib
import os
import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from tracker.files.atomic import size_of
from tracker.sequences.built_in import BUILT_IN, ROOMS, cached_rooms
from tracker.sequences.errors import SequenceError
from tracker.sequences.fields import did_you_mean, listed
from tracker.sequences.reader import FILE, given_folder, read_sequence, read_summary
from tracker.sequences.sequence import DetectorFile, Sequence

_SEEDED = re.compile(r"random-\d{1,9}")
"""A room that an earlier version of the program rendered by a seed."""

_RENDERED = re.compile(rf"({'|'.join(BUILT_IN)})-([23])-cameras")
"""A built-in room as an earlier version rendered it, with so many cameras."""


@dataclass(frozen=True, slots=True)
class SequenceEntry:
    """One line of the list of sequences."""

    name: str
    """What :func:`open_sequence` takes, or the folder's name under the data folder."""
    description: str
    kind: Literal["rendered", "folder"]
    """``rendered`` where the name alone opens it."""
    cameras: int
    frames: int
    """0 where the file leaves it to its videos."""
    folder: Path
    error: str | None = None
    """Why it cannot be opened, in one sentence."""


def available(data: Path | None = None) -> list[SequenceEntry]:
    """The built-in rooms, those of seeds that lie in the cache, then the folders under ``data``.

    Only heads of files are read: what else is wrong with a folder shows on opening it.
    """
    entries = [_entry(ROOMS / name, "rendered") for name in BUILT_IN]
    entries += [_entry(folder, "rendered") for folder in _folders(cached_rooms() / "random")]
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
        folder=folder,
        error=error,
    )


def is_room(name: str) -> bool:
    """Whether a name is that of a room: a built-in one, or one that may lie in the cache."""
    return name in BUILT_IN or _cached(name) is not None


def _cached(name: str) -> Path | None:
    """Where an earlier version of the program rendered the room of a name; None for other names."""
    if _SEEDED.fullmatch(name):
        return cached_rooms() / "random" / name
    return cached_rooms() / name if _RENDERED.fullmatch(name) else None


def open_sequence(name_or_folder: str | Path) -> Sequence:
    """Open a room by its name, or a sequence folder.

    A folder of the same name as a room is opened by a path with a separator, for instance
    ``./room44-3p``.

    Args:
        name_or_folder: Name of a room, or path of a folder.

    Raises:
        SequenceError: If there is no such sequence, or it cannot be read.
    """
    name = str(name_or_folder)
    if name in BUILT_IN:
        return read_sequence(ROOMS / name)
    cached = _cached(name)
    if cached is not None:
        if not (cached / FILE).is_file():
            raise SequenceError(
                f"{name} is not in the cache, and rooms are no longer rendered here: make a folder "
                f"with `python -m tests.rooms {_maker(name)} -o FOLDER` in a checkout of the "
                "source, and open that"
            )
        return read_sequence(cached)
    folder = given_folder(name_or_folder)
    if not folder.exists() and len(folder.parts) <= 1:
        hint = did_you_mean(name, BUILT_IN)
        raise SequenceError(
            f'there is no sequence "{name}": expected one of the built-in rooms '
            f"{listed(list(BUILT_IN))}, or the path of a folder with a {FILE}{hint}"
        )
    return read_sequence(folder)


def _maker(name: str) -> str:
    """What ``tests.rooms`` takes for a room that is missing."""
    match = _RENDERED.fullmatch(name)
    return name if match is None else f"{match[1]} --cameras {match[2]}"


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
        size_of(path)  # a pipe would be waited for
        with path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()[:16]
    except OSError as error:
        raise SequenceError(
            f"the detector {path} cannot be read ({error.strerror}); name an ONNX file"
        ) from error
    return replace(sequence, detector=DetectorFile(path, digest))
