"""The log of corrections, ``corrections.toml``: read, written whole or not at all, found.

It lies beside ``sequence.toml``; where that folder may only be read, or is the program's own, in
the user's settings.
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

from tracker.corrections.contradictions import refuse_contradiction
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
    """What a log says."""

    path: Path
    corrections: tuple[Correction, ...] = ()
    """In their order."""
    problem: str | None = None
    """Why it cannot be used, with its line; None where it can."""


def place_of(folder: Path) -> Path:
    """Where the log of a recording lies or would be written.

    Args:
        folder: Of the recording.
    """
    beside = folder / FILE
    if opens_by_name(folder):
        return _earlier_if_alone(folder)
    if _leads_out(beside):
        return own_place(folder)
    if os.access(beside if beside.exists() else folder, os.W_OK):
        return beside
    own = own_place(folder)
    # what came with a recording that may only be read counts until something is added to it
    return own if own.exists() or not beside.exists() else beside


def _leads_out(beside: Path) -> bool:
    """Whether the log of a recording is a link, which its reader and writer must not follow."""
    try:
        return beside.is_symlink() and not beside.resolve().is_relative_to(beside.parent.resolve())
    except (OSError, RuntimeError):  # a circle of links
        return True


def own_place(folder: Path) -> Path:
    """Where the log of a recording lies that may only be read: in the user's settings."""
    return _kept_as(key_of(folder))


def _kept_as(key: str) -> Path:
    return settings_folder() / "corrections" / f"{key}.toml"


def _earlier_if_alone(folder: Path) -> Path:
    """The log of a built-in sequence as it was rendered before counts until something is added."""
    own, key = own_place(folder), earlier_key(folder)
    earlier = own if key is None else _kept_as(key)
    return earlier if earlier.exists() and not own.exists() else own


def remark_on(folder: Path) -> str | None:
    """What must be said of a recording's log: that it is of an earlier rendering; else None."""
    earlier = earlier_key(folder)
    if earlier is None or place_of(folder) != _kept_as(earlier):
        return None
    return f"The corrections were {EARLIER}."


def writing_place(folder: Path) -> Path:
    """Where the log of a recording is written."""
    if opens_by_name(folder):
        return own_place(folder)
    found = place_of(folder)
    if found.parent == folder and not os.access(found if found.exists() else folder, os.W_OK):
        return own_place(folder)
    return found


def read_log(path: Path) -> tuple[Correction, ...]:
    """The corrections of a file, in its order; none where there is no file.

    Raises:
        CorrectionError: In one sentence: file, line, field, expected, found.
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
    """The log of a recording; one that cannot be used says so, and the recording stays usable."""
    path = place_of(folder)
    try:
        return Log(path, read_log(path))
    except CorrectionError as error:
        return Log(path, (), str(error))


def parse(text: str, where: str) -> tuple[Correction, ...]:
    """The corrections of a log.

    Args:
        text: TOML.
        where: The file, as the messages begin.

    Raises:
        CorrectionError: In one sentence: file, line, field, expected, found.
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
    if "kind" in table and table["kind"] not in list(KINDS):  # a table cannot be looked up
        known = ", ".join(KINDS)
        raise CorrectionError(
            f"{where}, line {_line_of(text, 'kind', line)}: kind: expected one of {known}, found "
            f"{table['kind']!r}"
        )
    try:
        # as a file that somebody wrote says it, a day or a time alone is none
        return Correction.model_validate(table)
    except ValidationError as error:
        first = error.errors()[0]
        field = str(first["loc"][0]) if first["loc"] else sentence_of(error).split(":")[0]
        raise CorrectionError(
            f"{where}, line {_line_of(text, field, line)}: {sentence_of(error)}"
        ) from None


def _line_of(text: str, field: str, first: int = 1) -> int:
    """The line on which a field stands, from its table's header on; else that of the header."""
    begins = re.compile(rf'^\s*(\[+\s*)?"?{re.escape(field)}"?\s*([=\].])')
    for number, line in enumerate(text.splitlines()[first - 1 :], first):
        if number > first and _HEADER.match(line):
            break
        if begins.match(line):
            return number
    return first


def dump(corrections: Iterable[Correction]) -> str:
    """The log as text."""
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
    return (time if time.tzinfo else time.replace(tzinfo=UTC)).astimezone(UTC)


def _places(one: Correction) -> Any:
    import tomlkit

    rows = tomlkit.array()
    for place in one.places:
        row = tomlkit.array()
        row.extend([place.step, *(round(value, 4) for value in place[1:])])
        rows.append(row)
    return rows.multiline(len(one.places) > 1)


def write_log(path: Path, corrections: Iterable[Correction]) -> None:
    """Write a log: wholly or not at all, whatever interrupts it.

    Raises:
        OSError: With a sentence, if it cannot be written; what was there still is.
    """
    text = dump(corrections)
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
