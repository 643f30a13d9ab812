"""JSON or XML of boxes by camera and frame, as one's own scripts and data sets have it.

``{"cam1": {"0": [[x1, y1, x2, y2, score], …]}}``, the frames outside and the cameras inside,
lists in place of either, boxes as tables of named fields, by a person's number, or as lists
beside each other (``boxes``, ``scores``, ``labels``) as torchvision and mmdetection have them;
one file, a file a camera, or a file a frame. Which level is which is told by its names: the
frames are the numbers of which there are most. In XML an element's attributes are its fields, as in
``<frame number="0"><objectlist><object id="1"><box xc="…" yc="…" w="…" h="…"/>`` (CAVIAR, PETS) and
``<frame num="1"><target_list><target id="1"><box left="…" …/>`` (UA-DETRAC).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import islice
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np

from tracker.io.read.columns import Column, layout_of, meanings, read_table
from tracker.io.read.detections.table import flat
from tracker.io.read.pieces import DetectionPiece, Piece
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import SourceFile, camera_of, is_camera_number, number_in
from tracker.io.read.values import plain

NAME = "boxes by camera and frame (JSON, XML)"
KIND: Kind = "detections"
SERIES = True

_TOGETHER: dict[str, tuple[str, ...]] = {
    "box": ("boxes", "bboxes", "predboxes", "detectionboxes", "xyxy", "detections"),
    "score": ("scores", "detectionscores", "confidences", "confs", "confidence", "score", "conf"),
    "class": ("labels", "classes", "detectionclasses", "classids", "categoryids", "classid"),
    "id": ("ids", "trackids", "trackerids", "trackerid"),
}
"""Of lists beside each other, one a field: what they are called."""

_SHARED = ("frame", "time", "camera")
"""Fields beside a list of boxes that hold for all of them."""

_NUMBERED = ("number", "num", "no", "nr", "id", "index")
"""Attributes of an XML element that say which one of its kind it is."""

_DEEPEST = 8
_LOOKED_AT = 300
"""Boxes by which a file is recognised."""

_FEWEST = 20
"""Lists of four parts of 1 that are believed to be boxes: a lens has four numbers too."""

Key = str | int
"""Of a table its field, of a list its place."""


class _Row(NamedTuple):
    path: tuple[Key, ...]
    """The levels that lead to it, without its place among the boxes there."""
    fields: Mapping[str, Any]
    """Of an empty list only what holds for all that it could hold."""
    empty: bool = False
    named: bool = False
    """Whether it is a table of named fields."""
    among: bool = False
    """Whether it is one of a list of boxes."""


class _Levels(NamedTuple):
    """Which level of a path says what; None where none does."""

    frame: int | None
    camera: int | None


def recognise(file: SourceFile) -> Certainty:
    """A tree in which lists of four to eight numbers, or boxes, lie under the numbers of frames."""
    begins = file.head_text.lstrip()[:1]
    if begins not in ("[", "{", "<") or (begins == "{" and file.json_lines is not None):
        return Certainty.NO
    rows = list(islice(_rows(_tree(file), (), {}), _LOOKED_AT))
    boxes = [row for row in rows if not row.empty]
    levels = _levels(rows)
    if not boxes or levels is None:
        return Certainty.NO
    known = levels.frame is not None or {"frame", "time"} & meanings(list(boxes[0].fields)).keys()
    if not known and (len(file.series) < 2 or number_in(file.path.name) is None):
        return Certainty.NO
    if boxes[0].named:
        return Certainty.LIKELY
    return Certainty.POSSIBLE if _are_boxes([row.fields["box"] for row in boxes]) else Certainty.NO


def read(file: SourceFile) -> Iterator[Piece]:
    """One piece a camera; of a series of files a frame, all together."""
    columns: list[dict[str, Any]] = []
    looked_at: list[tuple[str, int]] = []
    for path in file.series:
        member = file.member(path)
        own, empty = _records(member, number_in(path.name) if len(file.series) > 1 else None)
        timed = any("frame" not in meanings(list(record)) for record in own)
        if len(file.series) > 1 and (timed or any(not from_name for *_, from_name in empty)):
            yield from _pieces(member, own, [(c, f) for c, f, _ in empty])
            continue
        columns += own
        looked_at += [(camera, frame) for camera, frame, _ in empty]
    if columns:
        yield from _pieces(file, columns, looked_at)


def _pieces(
    file: SourceFile, records: list[dict[str, Any]], looked_at: Sequence[tuple[str, int]]
) -> Iterator[Piece]:
    """The boxes of a table; also of frames in which nobody is, it is known that they were seen."""
    names = list(dict.fromkeys(name for record in records for name in record))
    table: dict[str, Column] = {name: [r.get(name, "") for r in records] for name in names}
    frames = [frame for _, frame in looked_at]
    for piece in read_table(file, NAME, table):
        if isinstance(piece, DetectionPiece) and frames:
            known = piece.last_frame
            last = max(frames) if known is None else max(known, *frames)
            first = 0 if min(frames) == 0 else piece.first_index
            piece = replace(piece, last_frame=last, first_index=first)
        yield piece


def _records(
    file: SourceFile, number: int | None
) -> tuple[list[dict[str, Any]], list[tuple[str, int, bool]]]:
    """The boxes of a file with camera and frame; and every camera's frames that are in it, and
    whether they are told by the file's name."""
    rows = list(_rows(_tree(file), (), {}))
    if all(row.empty for row in rows):
        return [], [] if number is None else [("", number, True)]
    levels = _levels(rows)
    if levels is not None:  # an empty list elsewhere is none of boxes
        depth = len(next(row.path for row in rows if not row.empty))
        rows = [row for row in rows if len(row.path) == depth]
    else:
        raise file.error(
            "expected every box as many levels deep as the others, found some deeper; write them "
            "all as cameras, frames and boxes"
        )
    at = levels.frame
    several = at is not None and len({camera_of(str(row.path[at])) for row in rows}) > 1
    # of a file a frame it is how long the detector took, or when the file was written
    one_time = number is not None and len({_time_of(row) for row in rows if not row.empty}) == 1
    records: list[dict[str, Any]] = []
    looked_at: list[tuple[str, int, bool]] = []
    for row in rows:
        fields = dict(row.fields)
        found = meanings(list(fields))
        if levels.camera is not None and "camera" not in found:
            fields["camera"] = str(row.path[levels.camera])
        elif levels.frame is not None and "camera" not in found:
            own_camera = camera_of(str(row.path[levels.frame]))
            fields |= {"camera": own_camera} if several else {}
        if "frame" in found:
            own = _frame(str(fields[found["frame"]]))
            looked_at += [] if own is None else [(str(fields.get("camera", "")), own, False)]
        elif "time" not in found or one_time:
            own = number if levels.frame is None else _frame(row.path[levels.frame])
            if own is None:
                raise file.error(
                    f"{' › '.join(map(str, row.path)) or 'its boxes'}: expected the number of a "
                    'frame, found none; give each box a field "frame"'
                )
            fields["frame"] = own
            looked_at.append((str(fields.get("camera", "")), own, levels.frame is None))
        if not row.empty:
            records.append(fields)
    return records, looked_at


def _tree(file: SourceFile) -> Any:
    """The content of a file; of XML an element's attributes, and its children by their tags."""
    return _of_element(file.xml) if file.head_text.lstrip()[:1] == "<" else file.json


def _of_element(element: ElementTree.Element) -> dict[str, Any]:
    known = meanings([element.tag])
    fields: dict[str, Any] = {}
    for name, value in element.attrib.items():
        is_number = plain(name) in _NUMBERED and not known.keys().isdisjoint(("frame", "camera"))
        fields[element.tag if is_number else name] = value
    children: dict[str, list[Any]] = {}
    for child in element:
        text = (child.text or "").strip()
        alone = text and not child.attrib and not len(child)
        children.setdefault(child.tag, []).append(text if alone else _of_element(child))
    several = {tag: items[0] if len(items) == 1 else items for tag, items in children.items()}
    return {**fields, **several}


def _time_of(row: _Row) -> str:
    return str(row.fields.get(meanings(list(row.fields)).get("time", "")))


def _rows(value: Any, path: tuple[Key, ...], shared: Mapping[str, Any]) -> Iterator[_Row]:
    """Every box of a tree, and every empty list."""
    if len(path) > _DEEPEST:
        return
    if isinstance(value, dict):
        together = _together(value)
        if together is not None:
            yield from (_Row(path, {**shared, **fields}, among=True) for fields in together)
            return
        record = flat(value)
        known = meanings(list(record))
        if "box" in known or layout_of(known) is not None:
            numbers = record.get(known.get("box", ""))
            if numbers is None or isinstance(numbers, list):
                kept = {record_name: record[record_name] for record_name in known.values()}
                yield _Row(path, {**shared, **kept}, named=True)
                return
        own = {
            key: item
            for key, item in value.items()
            if isinstance(item, str | int | float)
            and any(meaning in _SHARED for meaning in meanings([key]))
        }
        for key, item in value.items():
            if isinstance(item, dict | list):
                yield from _rows(item, (*path, key), {**shared, **own})
    elif isinstance(value, list):
        if _is_box(value):
            yield _Row(path, {**shared, "box": value})
            return
        if not value:
            yield _Row(path, shared, empty=True)
            return
        is_row = [isinstance(item, dict) or _is_box(item) for item in value[:3]]
        for place, item in enumerate(value):
            for row in _rows(item, (*path, place), shared):
                # the place of a box among the others of its frame says nothing
                alone = all(is_row) and row.path == (*path, place) and _together(item) is None
                yield row._replace(path=path, among=True) if alone else row


def _together(value: Any) -> Iterator[dict[str, Any]] | None:
    """Boxes whose fields are lists beside each other."""
    if not isinstance(value, dict):
        return None
    lists: dict[str, list[Any]] = {}
    for key, item in value.items():
        for meaning, words in _TOGETHER.items():
            if plain(key) in words and isinstance(item, list):
                lists.setdefault(meaning, item)
    if not any(_is_box(box) for box in lists.get("box", ())[:1]):
        return None
    count = len(lists["box"])
    parts = {meaning: items for meaning, items in lists.items() if len(items) == count}
    if len(parts) == 1 and plain(next(iter(value))) == "detections":
        return None  # a plain list under that name
    return ({name: items[n] for name, items in parts.items()} for n in range(count))


def _is_box(value: Any) -> bool:
    """A list of four to eight numbers."""
    return (
        isinstance(value, list)
        and 4 <= len(value) <= 8
        and all(isinstance(item, int | float) and not isinstance(item, bool) for item in value)
    )


def _are_boxes(lists: Sequence[Sequence[float]]) -> bool:
    """Whether third and fourth are sizes or corners, of pixels or of many parts of a picture."""
    if len({len(one) for one in lists}) != 1:
        return False
    four = np.asarray(lists, dtype=float)[:, :4]
    positive = bool(((four[:, 2:] > 0.0).all(axis=1)).mean() > 0.95)
    return positive and (float(np.abs(four).max()) > 1.5 or len(four) >= _FEWEST)


def _frame(key: Key) -> int | None:
    """A place in a list, or the number in a name."""
    return key if isinstance(key, int) else number_in(key)


def _levels(rows: Sequence[_Row]) -> _Levels | None:
    """Which level holds the frames and which the cameras; None where boxes lie at several."""
    boxes = [row for row in rows if not row.empty]
    depths = Counter(len(row.path) for row in boxes)
    if len(depths) != 1:
        return None
    depth = next(iter(depths))
    keys = [{row.path[level] for row in rows if len(row.path) == depth} for level in range(depth)]
    own = meanings(list(boxes[0].fields))
    frame = None
    if not {"frame", "time"} & own.keys():
        numbered = [
            level
            for level, names in enumerate(keys)
            if all(_frame(name) is not None and not is_camera_number(name) for name in names)
        ]
        several = [level for level in numbered if len(keys[level]) > 1]
        plainly = [n for n in numbered if all(str(name).isdigit() for name in keys[n])]
        frame = max(several or plainly, key=lambda level: (len(keys[level]), -level), default=None)
    if "camera" in own:
        return _Levels(frame, None)
    for level, names in enumerate(keys):
        if (
            level == frame
            or (frame is None and not all(isinstance(n, str) for n in names))
            or (frame is not None and _are_people(rows, keys, level, frame))
        ):
            continue
        name = str(next(iter(names)))
        if len(names) > 1 or (isinstance(next(iter(names)), str) and _is_camera(name)):
            return _Levels(frame, level)
    return _Levels(frame, None)


def _are_people(rows: Sequence[_Row], keys: Sequence[set[Key]], level: int, frame: int) -> bool:
    """Whether the innermost level, below the frames, numbers the people of each frame."""
    innermost = level == len(keys) - 1 and frame < level
    among = any(row.among for row in rows)
    return innermost and not among and all(str(name).isdigit() for name in keys[level])


def _is_camera(name: str) -> bool:
    """Whether a single name is a camera's, not a word such as "results"."""
    return any(sign.isdigit() for sign in name) or plain(name).startswith(("cam", "view"))
