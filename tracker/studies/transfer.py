"""Recordings identified by their content, so that each machine may have them in another folder."""

from __future__ import annotations

import contextlib
import hashlib
import io
import tomllib
import zipfile
from pathlib import Path
from typing import Any

from tracker.files.atomic import new_folder, write_whole
from tracker.files.folders import cache_folder, files_matching
from tracker.sequences.errors import SequenceError
from tracker.sequences.library import open_sequence
from tracker.sequences.reader import FILE
from tracker.sequences.sequence import Sequence
from tracker.studies.errors import StudyError

SENT_BYTES = 256 << 20
"""Largest size of a recording that is sent to a worker which cannot read it, bytes."""


def files_of(folder: Path) -> list[Path]:
    """Return ``sequence.toml`` and all files below its folder that it names, sorted.

    A file is named if the text of any field is its path, or a pattern that matches it.
    """
    found = {folder / FILE}
    text = (folder / FILE).read_text(encoding="utf-8")
    for word in _words(tomllib.loads(text)):
        try:
            found |= set(files_matching(folder, word))
        except (ValueError, OSError):  # the text cannot be a path
            continue
    return sorted(found)


def _words(value: Any) -> list[str]:
    """Return all texts in nested values."""
    if isinstance(value, dict):
        return [word for one in value.values() for word in _words(one)]
    if isinstance(value, list):
        return [word for one in value for word in _words(one)]
    return [value] if isinstance(value, str) and value else []


def content_of(sequence: Sequence) -> str:
    """Return the hash of all files of a recording.

    It is cached under the recording's digest, which depends on the sizes and times of the files.
    """
    known = cache_folder() / "contents" / sequence.digest
    try:
        return known.read_text(encoding="ascii")
    except OSError:
        pass
    digest = hashlib.sha256()
    for path in files_of(sequence.folder):
        digest.update(path.relative_to(sequence.folder).as_posix().encode() + b"\0")
        with path.open("rb") as file:
            digest.update(hashlib.file_digest(file, "sha256").digest())
    content = digest.hexdigest()[:24]
    with contextlib.suppress(OSError):  # without the cache the hash is computed again
        known.parent.mkdir(parents=True, exist_ok=True)
        write_whole(known, content.encode("ascii"))
    return content


def packed(folder: Path, limit: int = SENT_BYTES) -> bytes:
    """Pack a recording into a ZIP file in memory.

    Args:
        folder: The recording's folder.
        limit: Largest total size of its files, bytes.

    Raises:
        StudyError: If the files are larger; the message names their size.
    """
    files = files_of(folder)
    size = sum(path.stat().st_size for path in files)
    if size > limit:
        raise StudyError(
            f"it has {size / 1e6:.0f} MB, and more than {limit / 1e6:.0f} MB are not sent; put it "
            "where every worker reads it under the same path"
        )
    whole = io.BytesIO()
    with zipfile.ZipFile(whole, "w", zipfile.ZIP_STORED) as archive:
        for path in files:
            archive.write(path, path.relative_to(folder).as_posix())
    return whole.getvalue()


def sent_folder(content: str) -> Path:
    """Return the folder for a recording that is sent to this machine, by its content."""
    return cache_folder() / "recordings" / content


def unpack(content: str, data: bytes) -> str:
    """Unpack a recording that was sent to this machine, and return its folder.

    Args:
        content: The hash of the recording's content.
        data: The recording, as returned by :func:`packed`.
    """
    folder = sent_folder(content)
    folder.parent.mkdir(parents=True, exist_ok=True)
    if not (folder / FILE).is_file():
        try:
            with new_folder(folder) as begun, zipfile.ZipFile(io.BytesIO(data)) as archive:
                archive.extractall(begun)
        except FileExistsError:
            if not (folder / FILE).is_file():  # otherwise another worker unpacked it meanwhile
                raise
    return str(folder)


def opened(place: str, content: str) -> Sequence:
    """Open a recording with a given content: from its place, or from the folder of recordings that
    were sent to this machine.

    Args:
        place: The name or folder by which the recording is opened.
        content: The hash of the recording's content.

    Raises:
        SequenceError: If neither has a recording with this content.
    """
    try:
        found = open_sequence(place)
        if content_of(found) == content:
            return found
        why = f"{place} has other files here than where the study was started"
    except (SequenceError, OSError) as error:
        why = " ".join(str(error).split())
    if (sent_folder(content) / FILE).is_file():
        return open_sequence(sent_folder(content))
    raise SequenceError(why)
