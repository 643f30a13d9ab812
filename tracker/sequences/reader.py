"""The reading of a folder with a ``sequence.toml`` into a validated :class:`Sequence`.

Every error is one sentence that names the file, the line or the field, what was expected and what
was found. Problems that do not prevent tracking become ``Sequence.warnings``.
"""

from __future__ import annotations

import hashlib
import os
import shlex
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from tracker.files.text import not_utf_8, shown
from tracker.sequences.errors import SequenceError
from tracker.sequences.fields import LARGEST_COUNT, LONGEST_NAME, Fields, did_you_mean
from tracker.sequences.filling import check_missing, find_room, find_time
from tracker.sequences.sequence import FileState, Sequence
from tracker.sequences.tables import OpenedFiles, read_ground_truth
from tracker.sequences.views import CAMERA, check_view_of_room, read_sources, read_views
from tracker.sequences.writing.teaching import read_room, read_target, read_templates

FILE = "sequence.toml"
FORMAT = 1
MOST_BYTES = 4 * 2**20
"""Largest size of a sequence.toml, which is enough for thousands of templates, bytes."""
LONGEST_PATH = 4000
"""Longest path that file systems accept, bytes."""
MOST_DEPTH = 12
"""Deepest nesting of tables and lists; the format itself needs five levels."""

TOP = ("format", "name", "description", "fps", "frames", "room", "target", "camera", "template",
       "ground_truth")  # fmt: skip

WHERE_NOW = "put it back, or name its new folder under Find… in the page's Library"
"""What to do about a recording that was moved."""


def why_missing(folder: Path) -> str | None:
    """Return why a recording is not in its folder any more; None if it is there, or if the folder
    may not be read.

    Args:
        folder: The folder in which the recording was when it was opened.
    """
    try:
        (folder / FILE).stat()
    except (FileNotFoundError, NotADirectoryError):
        return f"there is no {FILE} in {folder} any more"
    except OSError:
        return None
    return None


@dataclass(frozen=True, slots=True)
class SequenceSummary:
    """The summary of a sequence for lists, from its ``sequence.toml`` alone."""

    name: str
    """The name that is displayed."""
    description: str
    """The description, in words."""
    fps: float | None
    """The rate of the steps, 1/s; None if the file does not state it."""
    frames: int | None
    """The number of steps; None if the file does not state it."""
    cameras: int
    """The number of cameras."""


def read_sequence(folder: Path | str) -> Sequence:
    """Read and validate a sequence folder.

    What the file does not state is estimated: rate, number of steps and picture sizes from the
    videos, room and target from the places where boxes of two cameras agree. The warnings state the
    estimates.

    Args:
        folder: The folder, or the ``sequence.toml`` in it.

    Raises:
        SequenceError: If the folder is not a valid sequence; the message names the file and the
            line or field.
    """
    folder, text = _find(Path(folder))
    (own_file,) = _states(folder, [folder / FILE])
    fields = _parse(folder, text)
    reading = OpenedFiles(folder)
    frames = None
    if "frames" in fields:
        frames = fields.integer("frames", minimum=1, maximum=LARGEST_COUNT)
    fps = fields.rate("fps") if "fps" in fields else None
    room = read_room(fields) if "room" in fields else None
    half_extents = read_target(fields)
    check_missing(fields, _tables(fields))
    sources = read_sources(_tables(fields), reading)
    time = find_time(sources, fps, frames, fields)
    views = read_views(sources, time, reading)
    if room is None or half_extents is None:
        room, half_extents, remarks = find_room(views, room, half_extents, fields)
        reading.warnings += remarks
    reading.warnings += time.remarks
    reading.warnings += check_view_of_room([view.camera for view in views], room)
    templates = read_templates(fields, views, time.steps)
    ground_truth = read_ground_truth(fields, reading, time.steps)
    files = _states(folder, reading.files)
    digest = _digest(text, folder, files)
    return Sequence(
        name=fields.text("name"),
        folder=folder,
        fps=time.fps,
        frames=time.steps,
        room=room,
        target_half_extents=half_extents,
        views=views,
        description=fields.text("description", ""),
        templates=templates,
        ground_truth=ground_truth,
        digest=digest,
        stored_digest=digest,
        warnings=tuple(reading.warnings),
        files=files,
        own_file=own_file,
    )


def _tables(fields: Fields) -> list[Fields]:
    tables = fields.tables("camera", CAMERA, "[[camera]]")
    if not tables:
        raise fields.error("camera", "expected at least one table [[camera]], found none")
    return tables


def read_summary(folder: Path | str) -> SequenceSummary:
    """Read the summary of a sequence without opening its other files.

    Args:
        folder: The folder, or the ``sequence.toml`` in it.

    Raises:
        SequenceError: If the file cannot be read or one of these fields is not valid.
    """
    folder, text = _find(Path(folder))
    fields = _parse(folder, text)
    return SequenceSummary(
        name=fields.text("name"),
        description=fields.text("description", ""),
        fps=fields.rate("fps") if "fps" in fields else None,
        frames=fields.integer("frames", minimum=1, maximum=LARGEST_COUNT)
        if "frames" in fields
        else None,
        cameras=len(fields.tables("camera", CAMERA, "[[camera]]")),
    )


def _find(folder: Path) -> tuple[Path, str]:
    """Return the folder and the text of its sequence.toml."""
    if folder.name == FILE and folder.is_file():
        folder = folder.parent
    try:
        if not folder.exists():
            near = did_you_mean(folder.name, _names(folder.parent))
            raise SequenceError(f"{folder}: there is no such folder{near}")
        if not folder.is_dir():
            raise SequenceError(
                f"{folder}: expected a folder with a {FILE} in it, found a file; {_import(folder)}"
            )
        folder = folder.resolve()
        if not (folder / FILE).is_file():
            if os.path.lexists(folder / FILE):
                raise SequenceError(
                    f"{folder.name}/{FILE}: expected a file, found a folder, a pipe or a link that "
                    "leads nowhere; put the file there"
                )
            near = did_you_mean(FILE, _names(folder)) or f"; {_import(folder)}"
            raise SequenceError(f"{folder}: there is no {FILE} in this folder{near}")
        check_own_file(folder)
        return folder, (folder / FILE).read_text(encoding="utf-8-sig")
    except OSError as error:
        raise SequenceError(
            f"{folder}: cannot be read ({error.strerror}); check its permissions"
        ) from None
    except UnicodeDecodeError as error:
        raise SequenceError(f"{folder.name}/{FILE}, {not_utf_8(error)}") from None


def _import(source: Path) -> str:
    """Return a sentence with the command that imports files of other programs."""
    written = shlex.quote(str(source))
    return f"make one of other files by `multiview-phd import {written} -o NEW_FOLDER`"


def given_folder(text: str | Path) -> Path:
    """Expand ``~`` in a path that a user gave, and check that it can be a path.

    Raises:
        SequenceError: If file systems do not accept the path, or the user after ``~`` is unknown.
    """
    written = str(text)
    if not written.isprintable():
        odd = next(c for c in written if not c.isprintable())
        raise SequenceError(
            f"{shown(written)!s}: expected a path that can be printed, found the character "
            f"U+{ord(odd):04X} in it; name another"
        )
    try:
        path = Path(text).expanduser()
    except RuntimeError as error:
        raise SequenceError(f"{shown(written)}: is no path ({error}); write it in full") from None
    longest = max((len(os.fsencode(part)) for part in path.parts), default=0)
    if longest > LONGEST_NAME or len(os.fsencode(path)) > LONGEST_PATH:
        raise SequenceError(
            f"{shown(written)}: expected a path of at most {LONGEST_PATH} bytes, each name in it "
            f"of at most {LONGEST_NAME}, found {len(written)} characters; shorten it"
        )
    return path


def check_own_file(folder: Path) -> None:
    """Check that the ``sequence.toml`` of a folder can be read and overwritten.

    Raises:
        SequenceError: If the file is too large, or a link that leads out of the folder.
        OSError: If the file does not exist.
    """
    file = folder / FILE
    if not file.resolve().is_relative_to(folder.resolve()):
        raise SequenceError(
            f"{folder.name}/{FILE}: expected a file in the folder, found a link to {file.resolve()}"
            "; copy that file into the folder"
        )
    size = file.stat().st_size
    if size > MOST_BYTES:
        raise SequenceError(
            f"{folder.name}/{FILE}: expected at most {MOST_BYTES // 2**20} MB, found "
            f"{size / 2**20:,.0f} MB; put tables of boxes into CSV files"
        )


def _depth(values: object) -> int:
    """Return the depth of nested tables and lists, at most one more than is allowed."""
    level, depth = [values], 0
    while level and depth <= MOST_DEPTH:
        inner = [one for one in level if isinstance(one, dict | list)]
        level = [v for one in inner for v in (one.values() if isinstance(one, dict) else one)]
        depth += 1 if inner else 0
    return depth


def _names(folder: Path) -> list[str]:
    return [path.name for path in folder.iterdir()] if folder.is_dir() else []


def _parse(folder: Path, text: str) -> Fields:
    """Return the fields of ``sequence.toml``, or raise an error that names the place."""
    where = f"{folder.name}/{FILE}"
    try:
        values = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        problem, _, place = str(error).removesuffix(")").rpartition(" (at ")
        if place == "end of document":
            place = f"line {len(text.splitlines())}"
        raise SequenceError(f"{where}, {place}: is not valid TOML: {problem.lower()}") from None
    except RecursionError:
        raise SequenceError(
            f"{where}: expected tables and lists at most {MOST_DEPTH} levels deep, found hundreds; "
            "remove them"
        ) from None
    except ValueError:  # an integer of thousands of digits
        raise SequenceError(
            f"{where}: expected numbers of at most 18 digits, found one with thousands; shorten it"
        ) from None
    if _depth(values) > MOST_DEPTH:
        raise SequenceError(
            f"{where}: expected tables and lists at most {MOST_DEPTH} levels deep, found more; "
            "remove them"
        )
    version = values.get("format", FORMAT)
    if version != FORMAT:
        raise SequenceError(
            f"{where}, format: expected {FORMAT}, the only format this program reads, "
            f"found {shown(version)}"
        )
    fields = Fields(where, values, TOP)
    fields.integer("format", minimum=FORMAT, maximum=FORMAT)
    return fields


def _states(folder: Path, files: Iterable[Path]) -> tuple[FileState, ...]:
    try:
        return tuple(FileState.of(path) for path in files)
    except OSError as error:
        name = Path(str(error.filename)).name
        raise SequenceError(
            f'{folder.name}/{FILE}: the file "{name}" was there and cannot be found any '
            f"more ({error.strerror}); put it back, then open the folder again"
        ) from None


def saved_digest(sequence: Sequence) -> str:
    """Return the digest of a sequence whose ``sequence.toml`` was just written.

    Raises:
        OSError: If the file cannot be read.
    """
    text = (sequence.folder / FILE).read_text(encoding="utf-8-sig")
    return _digest(text, sequence.folder, sequence.files)


def _digest(text: str, folder: Path, files: tuple[FileState, ...]) -> str:
    digest = hashlib.sha256(text.encode())
    for file in files:
        name = file.path.relative_to(folder).as_posix()
        digest.update(f"{name} {file.size} {file.changed}\n".encode())
    return digest.hexdigest()[:16]
