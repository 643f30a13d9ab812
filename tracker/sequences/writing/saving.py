"""The saving of a changed sequence into its own file, or into a copy of its folder.

A file is replaced atomically, and its earlier content is kept beside it as a backup; a copy is
complete or not made at all. Only values that differ are changed in the text, so that comments,
order and notation of the rest are kept; the new text is parsed and compared with the wanted values
before it is written.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.items import AoT

from tracker.files.atomic import beside, replacing, sweep, sync_file, sync_folder, write_whole
from tracker.files.folders import cache_folder
from tracker.sequences.built_in import built_in_name
from tracker.sequences.errors import SequenceError
from tracker.sequences.reader import (
    FILE,
    WHERE_NOW,
    check_own_file,
    given_folder,
    read_sequence,
    why_missing,
)
from tracker.sequences.sequence import Sequence
from tracker.sequences.writing.teaching import (
    FACES,
    Pairs,
    Values,
    paired_entrances,
    paired_templates,
    taught_values,
)

BACKUP = f"{FILE}.bak"
"""The name of the backup of a file; later backups have a number."""

_TABLES = {".csv", ".npy"}
"""Endings of files that are edited, in contrast to pictures."""


def why_not_in_place(folder: Path) -> str | None:
    """Return the reason why a sequence cannot be saved in its folder; None if it can."""
    if built_in_name(folder) is not None:
        return f"{folder.name} comes with the program and is never written to"
    if folder.is_relative_to(cache_folder()):
        return f"{folder.name} lies in the cache, which may be emptied at any time"
    if why := why_missing(folder):
        return why
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
        SequenceError: If the folder was moved, the file may not be written, or its room, target or
            templates were changed meanwhile by another program; it is then unchanged.
    """
    folder, where = sequence.folder, f"{sequence.folder.name}/{FILE}"
    _check_there(folder, where)
    reason = why_not_in_place(folder)
    if reason is not None:
        raise SequenceError(f"{where}: cannot be saved, since {reason}; save a copy")
    with _complaining(folder / FILE):
        check_own_file(folder)  # it may have become a link since it was read
        path = (folder / FILE).resolve()
        # what another program wrote there since is still to be noticed afterwards
        own = saved.own_file if saved.own_file is not None and saved.own_file.is_same else None
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
        if own is not None:
            own.renew()
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
    source, built_in = sequence.folder, built_in_name(sequence.folder) is not None
    folder = given_folder(folder).absolute()
    _check_there(source, f"{source.name}/{FILE}")
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
            found = read_sequence(source)
            for path in {file.path for file in found.files} - {found.folder / FILE}:
                place = building / path.relative_to(found.folder)
                place.parent.mkdir(parents=True, exist_ok=True)
                # a link to a file of the program could be written through
                _copy(path, place, link=path.suffix.lower() not in _TABLES and not built_in)
            (building / FILE).write_bytes(text.encode("utf-8"))
            read_sequence(building)
            for written in building.rglob("*"):
                if written.name == FILE or written.suffix.lower() in _TABLES:
                    sync_file(written)
            sync_folder(building)
            os.replace(building, folder)
            sync_folder(folder.parent)
        except BaseException:
            shutil.rmtree(building, ignore_errors=True)
            raise
    return read_sequence(folder)


def _check_there(folder: Path, where: str) -> None:
    """Check that a sequence is still in its folder, before anything is written.

    Raises:
        SequenceError: If it was moved or deleted.
    """
    if why := why_missing(folder):
        raise SequenceError(f"{where}: cannot be saved, since {why}; {WHERE_NOW}")


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


def _copy(path: Path, place: Path, *, link: bool) -> None:
    if link:
        with contextlib.suppress(OSError):
            os.link(path.resolve(), place)
            return
    shutil.copyfile(path, place)


def _keep(folder: Path, data: bytes) -> Path:
    """Write a backup beside the file, under a name that does not exist yet."""
    path, number = folder / BACKUP, 1
    while os.path.lexists(path):  # what a link names is not ours to write
        number += 1
        path = folder / f"{BACKUP}{number}"
    write_whole(path, data)  # a half-written backup would be taken for a whole one
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


def rewritten(
    text: str, saved: Sequence, sequence: Sequence, where: str, *, name: str | None = None
) -> str:
    """Return the text of a ``sequence.toml`` with another room, target or templates.

    Args:
        text: The text of the file.
        saved: The sequence whose room, target and templates are in the text.
        sequence: The sequence whose room, target and templates are to be in the new text.
        where: The file's name, for messages.
        name: Another name for the sequence, or None.

    Raises:
        SequenceError: If the file does not have the room, target and templates of ``saved``.
    """
    values = tomllib.loads(text)
    before, after = taught_values(saved), taught_values(sequence)
    _check_unchanged(values, before, where)
    document: Any = tomlkit.parse(text)
    if name is not None:
        document["name"] = values["name"] = name
    if "room" in values:
        _write_room(document["room"], before["room"], after["room"])
    elif before["room"] != after["room"]:  # the file has no room; a user has now set one
        document["room"] = tomlkit.item(after["room"])
    if "target" in values:
        _write_target(document["target"], before["target"], after["target"])
    elif before["target"] != after["target"]:
        document["target"] = tomlkit.item(after["target"])
    _write_templates(document, before["template"], after["template"])
    result = tomlkit.dumps(document)
    if "\r\n" in text:
        result = result.replace("\r\n", "\n").replace("\n", "\r\n")
    got = tomllib.loads(result)
    if taught_in(got, after) != after or _rest_of(got) != _rest_of(values):
        raise SequenceError(
            f"{where}: is written in a way that cannot be kept while it changes; write [room], "
            "[target] and [[template]] as tables of their own, as the manual shows them under "
            "Format, then save again"
        )
    return result


def _write_room(table: Any, before: Values, after: Values) -> None:
    """Change the sides and entrances of the room in a TOML table, and nothing else."""
    for side, axis in FACES:
        if before[side][axis] != after[side][axis]:
            table[side][axis] = after[side][axis]
    old, new = before["entrances"], after["entrances"]
    if old == new:
        return
    if "entrances" not in table:
        table["entrances"] = tomlkit.array()
    entrances = table["entrances"]
    kept, gone, come = _steps(paired_entrances(old, new))
    for was, now in kept:
        for key in ("position", "sigma"):
            for axis in range(3):
                if old[was][key][axis] != new[now][key][axis]:
                    entrances[was][key][axis] = new[now][key][axis]
    for was in gone:
        del entrances[was]
    for now in come:
        if isinstance(entrances, AoT):
            entrances.insert(now, tomlkit.item(new[now]))
        else:
            _insert(entrances, now, new[now])


def _write_target(table: Any, before: Values, after: Values) -> None:
    sides = zip(before["half_extents"], after["half_extents"], strict=True)
    for axis, (old, new) in enumerate(sides):
        if old != new:
            table["half_extents"][axis] = new


def _insert(entrances: Any, index: int, entrance: Values) -> None:
    """Insert an entrance into a list; at the end, it gets a line of its own."""
    written = ", ".join(f"{key} = {value}" for key, value in entrance.items())
    table = tomlkit.parse(f"entrance = {{ {written} }}")["entrance"]
    if index < len(entrances):
        entrances.insert(index, table)
        return
    entrances.add_line(table, indent="  ")
    if not entrances.as_string().rstrip("]").endswith("\n"):
        entrances.add_line(indent="")


def _write_templates(document: Any, old: list[Values], new: list[Values]) -> None:
    """Change the templates in a TOML document, and nothing else."""
    if old == new:
        return
    if "template" in document and not new:
        del document["template"]
        return
    tables = document["template"] if "template" in document else tomlkit.aot()
    kept, gone, come = _steps(paired_templates(old, new))
    for was, now in kept:
        if old[was]["name"] != new[now]["name"]:
            tables[was]["name"] = new[now]["name"]
    for was in gone:
        del tables[was]
    for now in come:
        table: Any = tomlkit.table() if isinstance(tables, AoT) else tomlkit.inline_table()
        table.update(new[now])
        if isinstance(tables, AoT):
            table.add(tomlkit.nl())
        tables.insert(now, table)
    if "template" not in document:
        document.append("template", tables)


def _steps(pairs: Pairs) -> tuple[list[tuple[int, int]], list[int], list[int]]:
    """Return the pairs of a list that are kept, the indices to remove (last first), and to insert.

    The kept elements keep their order; an element that moves before an earlier one is removed and
    inserted again.
    """
    kept: list[tuple[int, int]] = []
    gone: list[int] = []
    come: list[int] = []
    for was, now in pairs:
        if was is None or now is None or (kept and was < kept[-1][0]):
            gone += [] if was is None else [was]
            come += [] if now is None else [now]
        else:
            kept.append((was, now))
    return kept, sorted(gone, reverse=True), sorted(come)


def _check_unchanged(values: dict[str, Any], before: Values, where: str) -> None:
    found = taught_in(values, before)
    words = {"room": "[room]", "target": "[target]", "template": "[[template]]"}
    for field, word in words.items():
        if found[field] != before[field]:
            raise SequenceError(
                f"{where}, {word}: expected what was there when it was opened, found other values: "
                "another program has changed the file; save a copy, or open it again"
            )


def taught_in(values: dict[str, Any], otherwise: Values | None = None) -> Values:
    """Return room, target and templates of a file in the form of :func:`taught_values`.

    Args:
        values: The parsed file.
        otherwise: The values of room and target if the file has none.
    """

    def numbers(vector: list[Any]) -> list[float]:
        return [float(value) for value in vector]

    room: dict[str, Any] = values["room"] if "room" in values else (otherwise or {})["room"]
    target: dict[str, Any] = values["target"] if "target" in values else (otherwise or {})["target"]
    return {
        "target": {"half_extents": numbers(target["half_extents"])},
        "room": {
            "min": numbers(room["min"]),
            "max": numbers(room["max"]),
            "entrances": [
                {key: numbers(entrance[key]) for key in ("position", "sigma")}
                for entrance in room.get("entrances", [])
            ],
        },
        "template": [
            {
                "name": " ".join(template["name"].split()),
                "camera": " ".join(template["camera"].split()),
                "frame": template["frame"],
                "box": numbers(template["box"]),
            }
            for template in values.get("template", [])
        ],
    }


def _rest_of(values: dict[str, Any]) -> dict[str, Any]:
    return {
        key: value for key, value in values.items() if key not in ("room", "target", "template")
    }
