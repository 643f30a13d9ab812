"""The log of corrections, ``corrections.toml``: its place, its reading and its atomic writing.

The file lies beside ``sequence.toml``; for a folder that is read-only or part of the program it
lies in the user's settings, and is taken from there when the folder can be written to again.
"""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from tracker.corrections.consistency import refuse_contradiction
from tracker.corrections.kinds import KINDS, Correction, CorrectionError, sentence_of
from tracker.files.atomic import replacing
from tracker.files.folders import settings_folder
from tracker.files.text import not_utf_8
from tracker.sequences.built_in import EARLIER, earlier_key, key_of, opens_by_name

FILE = "corrections.toml"
FORMAT = 1

_FIELDS = ("kind", "id", "time", "note", "name", "first", "last", "accuracy", "places")
_HEADER = re.compile(r"^\s*\[\[\s*correction\s*\]\]")
_MOST_BYTES = 32 << 20


@dataclass(frozen=True, slots=True)
class Log:
    """A log that was read."""

    path: Path
    """The file."""
    corrections: tuple[Correction, ...] = ()
    """The corrections in the order of the file."""
    problem: str | None = None
    """Why the log cannot be used, with the line; None where it can."""


def place_of(folder: Path) -> Path:
    """The path of the log of a recording, whether it exists or not.

    Args:
        folder: Folder of the recording.
    """
    beside, own = folder / FILE, own_place(folder)
    if opens_by_name(folder):
        return _earlier_if_alone(folder)
    if _leads_out(beside):
        return own
    if own.exists() and (_is_read_only(folder) or _written_later(own, beside)):
        return own
    # the log beside a read-only recording is used until a correction is added
    return beside if beside.exists() or not _is_read_only(folder) else own


def _is_read_only(folder: Path) -> bool:
    """Whether the log beside a recording, or else its folder, cannot be written to."""
    beside = folder / FILE
    return not os.access(beside if beside.exists() else folder, os.W_OK)


def _written_later(own: Path, beside: Path) -> bool:
    """Whether a recording was read-only, or its disk full, when its log was last written."""
    return not beside.exists() or own.stat().st_mtime_ns >= beside.stat().st_mtime_ns


def _leads_out(beside: Path) -> bool:
    """Whether the log is a link out of its folder, which must not be followed."""
    try:
        return beside.is_symlink() and not beside.resolve().is_relative_to(beside.parent.resolve())
    except (OSError, RuntimeError):  # a circle of links
        return True


def own_place(folder: Path) -> Path:
    """The path of the log of a read-only recording, in the user's settings."""
    return _settings_path(key_of(folder))


def _settings_path(key: str) -> Path:
    """The path in the user's settings of the log with a key."""
    return settings_folder() / "corrections" / f"{key}.toml"


def _earlier_if_alone(folder: Path) -> Path:
    """The log of a built-in room: that of an earlier rendering until a correction is added."""
    own, key = own_place(folder), earlier_key(folder)
    earlier = own if key is None else _settings_path(key)
    return earlier if earlier.exists() and not own.exists() else own


def remark_on(folder: Path) -> str | None:
    """The remark on a recording's log; None where there is nothing to remark.

    Either the log was made on an earlier rendering of a built-in room, or the settings have a
    second log, from when the folder could not be written to.
    """
    earlier, place, own = earlier_key(folder), place_of(folder), own_place(folder)
    if earlier is not None and place == _settings_path(earlier):
        return f"The corrections were {EARLIER}."
    if earlier is None and place != own and own.exists():
        return (
            f"Other corrections of this recording, made while its folder could not be written to, "
            f"are in {own}: `multiview-phd corrections merge` joins them with those of the folder."
        )
    return None


def writing_place(folder: Path) -> Path:
    """The path to which the log of a recording is written."""
    if opens_by_name(folder) or _leads_out(folder / FILE) or _is_read_only(folder):
        return own_place(folder)
    return folder / FILE


def read_log(path: Path) -> tuple[Correction, ...]:
    """Read the corrections of a file, in its order; none where there is no file.

    Raises:
        CorrectionError: If the file is invalid; the message has file, line, field, expected and
            found value.
    """
    try:
        if not path.exists():
            return ()
        if not path.is_file():
            raise CorrectionError(
                f"{path}: expected a file, found a folder, pipe or device; move it away"
            )
        size = path.stat().st_size
        if size > _MOST_BYTES:
            raise CorrectionError(
                f"{path}: expected a log of at most {_MOST_BYTES >> 20} MB, found "
                f"{size / 2**20:,.0f} MB; move it away"
            )
        text = path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise CorrectionError(f"{path}, {not_utf_8(error)}") from None
    except OSError as error:
        raise CorrectionError(f"{path}: cannot be read ({error.strerror})") from None
    return parse(text, str(path))


def open_log(folder: Path) -> Log:
    """Read the log of a recording; for an invalid one the result has the problem instead."""
    path = place_of(folder)
    try:
        return Log(path, read_log(path))
    except CorrectionError as error:
        return Log(path, (), str(error))


def parse(text: str, where: str) -> tuple[Correction, ...]:
    """Parse the corrections of a log.

    Args:
        text: The log as TOML.
        where: The name of the file, with which messages begin.

    Raises:
        CorrectionError: If the text is invalid; the message has file, line, field, expected and
            found value.
    """
    try:
        values = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise CorrectionError(f"{where}: expected TOML, found something else ({error})") from None
    except (RecursionError, ValueError):
        raise CorrectionError(
            f"{where}: expected a few levels and numbers of at most 18 digits, found more; "
            "shorten it"
        ) from None
    strange = sorted(set(values) - {"format", "correction"})
    if strange:
        raise CorrectionError(
            f"{where}, line {_line_of(text, strange[0])}: expected format and [[correction]], "
            f"found {strange[0]}"
        )
    if values.get("format", FORMAT) != FORMAT:
        raise CorrectionError(
            f"{where}, line {_line_of(text, 'format')}: expected format = {FORMAT}, found "
            f"{values['format']!r}; a newer program wrote it"
        )
    tables = values.get("correction", [])
    if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
        raise CorrectionError(
            f"{where}, line {_line_of(text, 'correction')}: expected tables [[correction]]"
        )
    lines = [number for number, line in enumerate(text.splitlines(), 1) if _HEADER.match(line)]
    found: list[Correction] = []
    for number, table in enumerate(tables):
        line = lines[number] if number < len(lines) else 1
        one = _correction(table, text, where, line)
        if any(one.id == other.id for other in found):
            raise CorrectionError(
                f"{where}, line {line}: id: expected each once, found {one.id} again"
            )
        try:
            refuse_contradiction(found, one)
        except CorrectionError as error:
            raise CorrectionError(f"{where}, line {line}: {error}") from None
        found.append(one)
    return tuple(found)


def _correction(table: dict[str, Any], text: str, where: str, line: int) -> Correction:
    """Return the correction of a table of the log, or raise an error that names file, line and
    field."""
    if "kind" in table and table["kind"] not in list(KINDS):  # a table cannot be looked up
        known = ", ".join(KINDS)
        raise CorrectionError(
            f"{where}, line {_line_of(text, 'kind', line)}: kind: expected one of {known}, found "
            f"{table['kind']!r}"
        )
    try:
        # the types of TOML are checked, and a date or a time alone is not converted
        return Correction.model_validate(table)
    except ValidationError as error:
        first = error.errors()[0]
        field = str(first["loc"][0]) if first["loc"] else sentence_of(error).split(":")[0]
        raise CorrectionError(
            f"{where}, line {_line_of(text, field, line)}: {sentence_of(error)}"
        ) from None


def _line_of(text: str, field: str, first: int = 1) -> int:
    """The line of a field after the header of its table at ``first``; else that of the header."""
    begins = re.compile(rf'^\s*(\[+\s*)?"?{re.escape(field)}"?\s*([=\].])')
    for number, line in enumerate(text.splitlines()[first - 1 :], first):
        if number > first and _HEADER.match(line):
            break
        if begins.match(line):
            return number
    return first


def dump(corrections: Iterable[Correction]) -> str:
    """Format corrections as the text of a log."""
    import tomlkit

    document = tomlkit.document()
    document.add(
        tomlkit.comment("What a person put right; each place is [step, x, y, z] in metres")
    )
    document.add("format", tomlkit.item(FORMAT))
    tables = tomlkit.aot()
    for one in corrections:
        table = tomlkit.table()
        values = one.model_dump(exclude_none=True)
        for field in _FIELDS:
            value = values.get(field)
            if value in (None, "", ()):
                continue
            if field == "time":
                value = _in_utc(one.time)
            if field == "places":
                table.add(field, _places(one))
                continue
            table.add(field, value)
        tables.append(table)
    if len(tables):
        document.add("correction", tables)
    return tomlkit.dumps(document)


def _in_utc(time: datetime) -> datetime:
    """A time in UTC; one without a zone is taken as UTC."""
    return (time if time.tzinfo else time.replace(tzinfo=UTC)).astimezone(UTC)


def _places(one: Correction) -> Any:
    """The places of a correction as a TOML array, rounded to a tenth of a millimetre."""
    import tomlkit

    rows = tomlkit.array()
    for place in one.places:
        row = tomlkit.array()
        row.extend([place.step, *(round(value, 4) for value in place[1:])])
        rows.append(row)
    return rows.multiline(len(one.places) > 1)


def write_log(path: Path, corrections: Iterable[Correction]) -> None:
    """Write a log atomically.

    Raises:
        OSError: If it cannot be written; the file before is then unchanged.
    """
    text = dump(corrections)
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
