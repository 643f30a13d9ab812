"""The change of room, target or templates in the text of a ``sequence.toml``.

Only values that differ are changed, so that comments, order and notation of the rest are kept. The
new text is parsed and compared with the wanted values before it is returned.
"""

from __future__ import annotations

import tomllib
from typing import Any

import tomlkit
from tomlkit.items import AoT

from tracker.sequences.errors import SequenceError
from tracker.sequences.sequence import Sequence
from tracker.sequences.writing.teaching import (
    FACES,
    Pairs,
    Values,
    paired_entrances,
    paired_templates,
    taught_values,
)


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
