"""The saving of a changed sequence into its own file, or into a copy of its folder.

A file is replaced atomically, and its earlier content is kept beside it as a backup; a copy is
complete or not made at all.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tracker.files.atomic import beside, replacing, sweep, sync_file, sync_folder
from tracker.files.folders import cache_folder
from tracker.sequences.built_in import built_in_name
from tracker.sequences.errors import SequenceError
from tracker.sequences.reader import FILE, check_own_file, given_folder, read_sequence
from tracker.sequences.sequence import Sequence

BACKUP = f"{FILE}.bak"
"""The name of the backup of a file; later backups have a number."""


def why_not_in_place(folder: Path) -> str | None:
    """Return the reason why a sequence cannot be saved in its folder; None if it can."""
    if built_in_name(folder) is not None:
        return f"{folder.name} comes with the program and is never written to"
    if folder.is_relative_to(cache_folder()):
        return f"{folder.name} lies in the cache, which may be emptied at any time"
    if not os.access(folder, os.W_OK) or not os.access(folder / FILE, os.W_OK):
        return f"{folder} is a place that you may only read"
    return None


def save(sequence: Sequence, saved: Sequence) -> Path:
    """Write room and templates into the sequence's own file.

    Args:
        sequence: The sequence with the changes.
        saved: The sequence as it was last read or saved.

    Returns:
        The path of the backup.

    Raises:
        SequenceError: If the file may not be written, or its room, target or templates were
            changed meanwhile by another program; it is then unchanged.
    """
    from tracker.sequences.writing.rewriting import rewritten

    folder, where = sequence.folder, f"{sequence.folder.name}/{FILE}"
    reason = why_not_in_place(folder)
    if reason is not None:
        raise SequenceError(f"{where}: cannot be saved, since {reason}; save a copy")
    with _complaining(folder / FILE):
        check_own_file(folder)  # it may have become a link since it was read
        path = (folder / FILE).resolve()
        before = path.read_bytes()
        text = rewritten(before.decode("utf-8-sig"), saved, sequence, where)
        backup = _keep(folder, before)
        mark = b"\xef\xbb\xbf" if before.startswith(b"\xef\xbb\xbf") else b""
        try:
            with replacing(path) as temporary:
                temporary.write_bytes(mark + text.encode("utf-8"))
                shutil.copymode(path, temporary)
        except BaseException:
            backup.unlink(missing_ok=True)  # of a file that is as it was
            raise
    return backup


def save_copy(sequence: Sequence, saved: Sequence, folder: Path) -> Sequence:
    """Write a sequence with all its files into another folder, under that folder's name.

    Pictures and videos are hard links if the file system supports them, and so take no space;
    tables are copied, so that editing the copy does not change the original.

    Args:
        sequence: The sequence with the changes.
        saved: The sequence as it was last read or saved.
        folder: The folder of the copy, which must be new or empty.

    Returns:
        The copy, read from there.

    Raises:
        SequenceError: If the copy cannot be written; no file is left then.
    """
    from tracker.sequences.writing.rewriting import rewritten

    source, built_in = sequence.folder, built_in_name(sequence.folder) is not None
    folder = given_folder(folder).absolute()
    _check_place(folder, source)
    with _complaining(folder):
        folder.parent.mkdir(parents=True, exist_ok=True)
        sweep(folder.parent, folder.name)
        building = beside(folder)
        try:
            building.mkdir()
            text = (source / FILE).read_bytes().decode("utf-8-sig")
            text = rewritten(text, saved, sequence, f"{source.name}/{FILE}", name=folder.name)
            # of a copy that was just saved the pictures are still read where they were before
            for path in _files(read_sequence(source), tomllib.loads(text)):
                place = building / path.relative_to(source)
                place.parent.mkdir(parents=True, exist_ok=True)
                # a link to a file of the program could be written through
                _copy(path, place, link=path.suffix.lower() != ".csv" and not built_in)
            (building / FILE).write_bytes(text.encode("utf-8"))
            read_sequence(building)
            for written in (building / FILE, *building.rglob("*.csv")):
                sync_file(written)
            sync_folder(building)
            os.replace(building, folder)
            sync_folder(folder.parent)
        except BaseException:
            shutil.rmtree(building, ignore_errors=True)
            raise
    return read_sequence(folder)


def _check_place(folder: Path, source: Path) -> None:
    """Check that a copy can be made in a folder, before anything is written."""
    if folder.resolve().is_relative_to(source):
        raise SequenceError(
            f"{folder}: expected a folder beside the sequence, found one inside it; choose another"
        )
    if folder.is_file():
        raise SequenceError(f"{folder}: expected a new folder, found a file; choose another name")
    if folder.is_dir() and any(folder.iterdir()):
        raise SequenceError(
            f"{folder}: expected a new or an empty folder, found one with "
            f"{len(list(folder.iterdir()))} files in it; choose another name"
        )


def _files(sequence: Sequence, values: dict[str, Any]) -> Iterator[Path]:
    """Yield every file of the sequence apart from its ``sequence.toml``."""
    for view, camera in zip(sequence.views, values["camera"], strict=True):
        if view.video is not None:
            yield view.video
        yield from (path for path in view.images if path.exists())  # some may be missing
        if "detections" in camera:
            yield sequence.folder / camera["detections"]
    if "ground_truth" in values:
        yield sequence.folder / values["ground_truth"]["file"]


def _copy(path: Path, place: Path, *, link: bool) -> None:
    if place.exists():  # two cameras may name one file
        return
    if link:
        with contextlib.suppress(OSError):
            os.link(path.resolve(), place)
            return
    shutil.copyfile(path, place)


def _keep(folder: Path, data: bytes) -> Path:
    """Write a backup beside the file, under a name that does not exist yet."""
    number = 1
    while True:
        path = folder / (BACKUP if number == 1 else f"{BACKUP}{number}")
        try:
            file = path.open("xb")
        except FileExistsError:
            number += 1
            continue
        try:
            with file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
        except BaseException:
            path.unlink(missing_ok=True)  # an empty backup would be taken for one
            raise
        return path


@contextlib.contextmanager
def _complaining(path: Path) -> Iterator[None]:
    """Turn an error of the disk into a :class:`SequenceError` with one sentence."""
    try:
        yield
    except OSError as error:
        words = f"{error.filename or path}: cannot be written ({error.strerror})"
        raise SequenceError(
            f"{words if error.strerror else error}; choose another folder, or make room there"
        ) from None
