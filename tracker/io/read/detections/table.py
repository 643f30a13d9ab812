"""CSV with a header, or JSON of records: supervision's sinks, Ultralytics, one's own.

Columns in any order; see :mod:`tracker.io.read.columns`. A file a frame (Ultralytics'
``to_json`` and ``to_csv``) has its frame in its name.

Sources: supervision, "Save detections" (CSVSink, JSONSink: x_min, y_min, x_max, y_max);
Ultralytics, ``Results.summary`` (name, class, confidence, box with x1, y1, x2, y2).
"""

from __future__ import annotations

import ast
import csv
import io
import re
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from tracker.io.read.columns import (
    Column,
    decimal_point,
    delimiter_of,
    is_table,
    layout_of,
    meanings,
    read_table,
)
from tracker.io.read.pieces import FormatError, Piece
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import SourceFile, is_camera_number, number_in
from tracker.io.read.values import is_list_of_tables, plain

_OF_PERSON = re.compile(
    r"(?:(?:p|id|person|ped|pedestrian|player|subject|target|track|human|object)[ _.-]?)?"
    r"(?P<number>\d+)[ _.-]?(?P<axis>[xyz])|(?P<before>[xyz])[ _.-]?(?P<after>\d+)"
)
"""The name of a column with a coordinate of one person."""

_CORNERS = 0.9
"""Share of rows in which the second of two points is right of and below the first of a box."""

_LENS = frozenset(("fx", "focal", "focallength", "intrinsics", "cameramatrix", "k"))
"""Names of which a record of a camera has one beside its position."""

NAME = "table of boxes or places (CSV, JSON)"
KIND: Kind = "detections"
SERIES = True


def recognise(file: SourceFile) -> Certainty:
    """A header, or records, with the names of a box or of a person's place."""
    start = file.head_text.lstrip()[:1]
    if start in ("[", "{"):
        words = ("box", "x_min", "xmin", "x1", "left", '"x"', "xyz", "position", "location")
        if not any(word in file.head_text for word in words):
            return Certainty.NO
        records = _records(file)
        names = list(flat(records[0][1])) if records else []
        if not _LENS.isdisjoint(map(plain, names)):
            return Certainty.NO
        return Certainty.LIKELY if is_table(names) else Certainty.NO
    lines = _data_lines(file.head_text)
    names = _cells(lines[0], delimiter_of(lines[0])) if lines else []
    known = len(names) > 3 and (is_table(names) or bool(_people_of(names)))
    return Certainty.LIKELY if known else Certainty.NO


def read(file: SourceFile) -> Iterator[Piece]:
    """One piece a camera; of a series of files a frame, all together."""
    parts = [_columns(file.member(path)) for path in file.series]
    alone = [bool({"frame", "time"} & meanings(list(columns)).keys()) for columns, _ in parts]
    # cam1.csv, cam2.csv … without frames are no frames either
    of_cameras = all(is_camera_number(path.stem) for path in file.series)
    if len(parts) == 1 or any(alone) or of_cameras:
        for path, (columns, frames) in zip(file.series, parts, strict=True):
            member = file.member(path)
            if columns:
                name = _name(columns)
                yield from read_table(member, name, {**columns, **_own_frames(columns, frames)})
        return
    names = list(dict.fromkeys(name for columns, _ in parts for name in columns))
    together: dict[str, list[Any]] = {name: [] for name in names}
    together["frame"] = []
    for path, (columns, _) in zip(file.series, parts, strict=True):
        rows = len(next(iter(columns.values()), ()))
        for name in names:
            together[name] += list(columns.get(name, [""] * rows))
        together["frame"] += [number_in(path.name)] * rows
    if together["frame"]:
        yield from read_table(file, _name(together), together)


def _own_frames(columns: Mapping[str, Column], frames: list[int] | None) -> dict[str, Column]:
    has_one = "frame" in meanings(list(columns))
    return {} if has_one or frames is None else {"frame": frames}


def _name(columns: Mapping[str, Column]) -> str:
    names = set(columns)
    if {"x_min", "y_min", "x_max", "y_max", "tracker_id"} <= names:
        return "supervision sink"
    if {"name", "class", "confidence"} <= names:
        return "Ultralytics results"
    return "table"


def _columns(file: SourceFile) -> tuple[dict[str, Column], list[int] | None]:
    """Cells by column; and of a list of lists the frame of each row."""
    if file.head_text.lstrip()[:1] in ("[", "{"):
        records = [(frame, flat(record)) for frame, record in _records(file)]
        names = list(dict.fromkeys(name for _, record in records for name in record))
        columns: dict[str, Column] = {
            name: [record.get(name, "") for _, record in records] for name in names
        }
        frames = [frame for frame, _ in records]
        return columns, None if None in frames else [f for f in frames if f is not None]
    lines = _data_lines(file.text())
    if not lines:
        return {}, None
    delimiter = delimiter_of(lines[0])
    try:
        rows = list(csv.reader(io.StringIO("\n".join(lines)), delimiter=delimiter))
    except csv.Error as error:
        raise file.error(f"is not a CSV table ({error})") from None
    names = [name.strip() for name in rows[0]]
    for line, row in enumerate(rows[1:], 2):
        if len(row) != len(names):
            raise file.error(
                f"row {line}: expected {len(names)} columns as in the header, found {len(row)}"
            )
    if delimiter != ",":
        rows = [[decimal_point(cell) for cell in row] for row in rows]
    cells = list(zip(*rows[1:], strict=True)) or [()] * len(names)
    return _a_row_a_person(_with_boxes(dict(zip(names, cells, strict=True)))), None


def _people_of(names: list[str]) -> dict[str, dict[str, str]]:
    """The columns x, y and z of each person of a table that has some for each, by the person.

    They are called ``x1, y1, x2, y2`` … or ``person1_x, person1_y`` …
    """
    people: dict[str, dict[str, str]] = {}
    for name in names:
        match = _OF_PERSON.fullmatch(name.strip().lower())
        if match is not None:
            number = match["number"] or match["after"]
            people.setdefault(number, {})[match["axis"] or match["before"]] = name
    whole = {number: own for number, own in people.items() if {"x", "y"} <= own.keys()}
    when = {"frame", "time"} & meanings(names).keys()
    return whole if len(whole) > 1 and when else {}


def _a_row_a_person(columns: dict[str, Column]) -> dict[str, Column]:
    """A table with columns for each person as one with a row for each; any other as it is.

    Two people of whom the second is nearly always right of and below the first are a box.
    """
    people = _people_of(list(columns))
    if not people:
        return columns
    if layout_of(meanings(list(columns))) is not None and len(people) == 2:
        corners = [columns[people[n][axis]] for axis in "xy" for n in sorted(people)]
        try:
            left, right, top, bottom = np.array(corners, dtype=float)
        except ValueError:  # a person who is not there
            left, right, top, bottom = np.zeros((4, 1))
        if ((right > left) & (bottom > top)).mean() > _CORNERS:
            return columns
    found = meanings(list(columns))
    when = found.get("frame", found.get("time", ""))
    long: dict[str, Column] = {
        when: [cell for _ in people for cell in columns[when]],
        "id": [number for number in people for _ in columns[when]],
    }
    for axis in "xyz":
        if all(axis in own for own in people.values()):
            long[axis] = [cell for own in people.values() for cell in columns[own[axis]]]
    return long


def _with_boxes(columns: dict[str, Column]) -> dict[str, Column]:
    """A column of boxes in Python's notation, as a data frame prints them, as columns."""
    box = meanings(list(columns)).get("box")
    if box is None or layout_of(meanings(list(columns))) is not None:
        return columns
    try:
        cells = [ast.literal_eval(cell[:1000]) for cell in columns[box]]
    except (ValueError, SyntaxError, MemoryError, RecursionError):
        return columns
    if cells and all(isinstance(cell, dict) for cell in cells):
        parts: dict[str, Column] = {part: [c.get(part, "") for c in cells] for part in cells[0]}
        return {**columns, **parts}
    return {**columns, box: cells}


def _records(file: SourceFile) -> list[tuple[int | None, dict[str, Any]]]:
    """Records with their frame, where they are in a list a frame."""
    values = file.json if file.json_lines is None else _of_lines(file.json_lines)
    if isinstance(values, dict):  # one list under some name
        lists = [value for value in values.values() if is_list_of_tables(value) and value]
        values = lists[0] if len(lists) == 1 else []
    if not isinstance(values, list):
        return []
    if values and all(isinstance(item, list) for item in values):
        return [
            (frame, record)
            for frame, records in enumerate(values)
            for record in records
            if isinstance(record, dict)
        ]
    records = [record for record in values if isinstance(record, dict)]
    expanded = _of_lines(records)
    placed = bool(expanded) and "place" in meanings(list(expanded[0]))
    return [(None, record) for record in (expanded if placed else records)]


def _of_lines(values: list[Any]) -> list[dict[str, Any]]:
    """The records of lines; those of a list among a line's fields each with its other fields."""
    records: list[dict[str, Any]] = []
    for line in values:
        if not isinstance(line, dict):
            continue
        several = [key for key, value in line.items() if is_list_of_tables(value)]
        if len(several) == 1:
            shared = {key: value for key, value in line.items() if key != several[0]}
            records += [{**shared, **own} for own in line[several[0]]]
        else:
            records.append(line)
    return records


def flat(record: Mapping[str, Any]) -> dict[str, Any]:
    """A record with the fields of its box, or of its place, as its own."""
    flat = {key: value for key, value in record.items() if not isinstance(value, dict)}
    for key in ("box", "bbox", "bounding_box", "position", "location"):
        if isinstance(record.get(key), dict):
            flat.update(record[key])
    return flat


def _data_lines(text: str) -> list[str]:
    """The header and the rows; a header may be a comment, and blanks may stand for commas."""
    lines = [line for line in text.splitlines() if line.strip()]
    first = next((n for n, line in enumerate(lines) if not line.startswith("#")), len(lines))
    header = lines[first - 1].lstrip("#") if first else ""
    if first < len(lines) and not re.search("[A-Za-z]", lines[first]) and header:
        lines[first - 1], first = header, first - 1
    lines = lines[first:]
    if lines and not any(sign in lines[0] for sign in ",;\t"):
        lines = [",".join(line.split()) for line in lines]
    return lines


def _cells(line: str, delimiter: str) -> list[str]:
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter), [])]
    except (csv.Error, FormatError):
        return []
