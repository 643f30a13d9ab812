"""The opening of sequences: built-in recordings by name, folders by path."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from tracker.sequences.built_in import BUILT_IN, ROOMS, cached_rooms
from tracker.sequences.detectors import check_model_size, sha256_of, usable_detector
from tracker.sequences.errors import SequenceError
from tracker.sequences.fields import did_you_mean, listed
from tracker.sequences.reader import FILE, given_folder, read_sequence, read_summary
from tracker.sequences.sequence import DetectorFile, Sequence

_SEEDED = re.compile(r"random-\d{1,9}")
"""The name of a random recording that an earlier version of the program rendered by a seed."""

_RENDERED = re.compile(rf"({'|'.join(BUILT_IN)})-([23])-cameras")
"""The name of a built-in recording that an earlier version rendered with 2 or 3 cameras."""


@dataclass(frozen=True, slots=True)
class SequenceEntry:
    """An entry of the list of sequences."""

    name: str
    """The name for :func:`open_sequence`, or the folder's name in the data folder."""
    description: str
    """The description, in words."""
    kind: Literal["rendered", "folder"]
    """``rendered`` if the sequence can be opened by its name."""
    cameras: int
    """The number of cameras."""
    frames: int
    """The number of steps; 0 if the file does not state it."""
    folder: Path
    """The folder of the sequence, without symbolic links, as that of an open one."""
    error: str | None = None
    """The reason why the sequence cannot be opened, in one sentence."""


def available(data: Path | None = None) -> list[SequenceEntry]:
    """Return the built-in recordings, random ones in the cache, then the folders in ``data``.

    Only ``sequence.toml`` is read; problems of other files appear when a sequence is opened.
    """
    entries = [_entry(ROOMS / name, "rendered") for name in BUILT_IN]
    entries += [_entry(folder, "rendered") for folder in _folders(cached_rooms() / "random")]
    if data is not None and data.is_dir():
        entries += [_entry(folder) for folder in _folders(data)]
    return entries


def _folders(data: Path) -> list[Path]:
    """Return the folders in ``data`` that have a ``sequence.toml``, readable or not."""
    try:
        with os.scandir(data) as inside:
            names = sorted(entry.name for entry in inside if not entry.name.startswith("."))
    except OSError:
        return []
    return [data / name for name in names if os.path.lexists(data / name / FILE)]


def _entry(folder: Path, kind: Literal["rendered", "folder"] = "folder") -> SequenceEntry:
    """Return the entry of a folder, with the reason if it cannot be read."""
    description, cameras, frames, error = "", 0, 0, None
    try:
        summary = read_summary(folder)
        description, cameras = summary.description, summary.cameras
        frames = summary.frames or 0
    except (ValueError, OSError, RecursionError, MemoryError) as problem:
        # the problem of one folder is shown in its entry and does not affect the others
        error = " ".join(str(problem).split()) or type(problem).__name__
    return SequenceEntry(
        name=folder.name,
        description=description,
        kind=kind,
        cameras=cameras,
        frames=frames,
        folder=folder.resolve(),
        error=error,
    )


def is_room(name: str) -> bool:
    """Whether a name is that of a built-in recording, or of one that may be in the cache."""
    return name in BUILT_IN or _cached(name) is not None


def _cached(name: str) -> Path | None:
    """Return the folder into which an earlier version rendered the recording of this name; None for
    other names."""
    if _SEEDED.fullmatch(name):
        return cached_rooms() / "random" / name
    return cached_rooms() / name if _RENDERED.fullmatch(name) else None


def open_sequence(name_or_folder: str | Path) -> Sequence:
    """Open a recording by its name, or a sequence folder, with the detection network at hand.

    A folder with the name of a built-in recording is opened by a path with a separator, for
    instance ``./room44-3p``.

    Args:
        name_or_folder: The name of a built-in recording, or the path of a folder.

    Raises:
        SequenceError: If there is no such sequence, or it cannot be read.
    """
    sequence = _read(name_or_folder)
    if not sequence.has_pictures:
        return sequence
    detector, damaged = usable_detector()
    warnings = (*sequence.warnings, damaged) if damaged else sequence.warnings
    return replace(sequence, detector=detector, warnings=warnings)


def _read(name_or_folder: str | Path) -> Sequence:
    """Read a recording by its name, or a sequence folder."""
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
    """Return the arguments of ``tests.rooms`` that render a missing recording."""
    match = _RENDERED.fullmatch(name)
    return name if match is None else f"{match[1]} --cameras {match[2]}"


def with_detector(sequence: Sequence, path: Path | None) -> Sequence:
    """Return a sequence with a detection network that can be run on its pictures.

    Args:
        sequence: The sequence.
        path: The network's ONNX file; if None, the sequence is returned unchanged, with the fetched
            network if one is at hand.

    Raises:
        SequenceError: If the file cannot be read.
    """
    if path is None:
        return sequence
    try:
        check_model_size(path)
        digest = sha256_of(path)[:16]
    except OSError as error:
        raise SequenceError(
            f"the detector {path} cannot be read ({error.strerror}); name an ONNX file"
        ) from error
    return replace(sequence, detector=DetectorFile(path, digest))
