"""Label Studio's export of rectangles, "JSON" and "JSON-MIN", of pictures and of videos.

Numbers are percents of the picture. A video's rectangles are key frames, counted from 1,
between which those that are enabled move evenly; a picture's frame is the number in its name.

Source: Label Studio, "Label Studio JSON format of annotated tasks" and "Video object tracking".
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any, Literal, NamedTuple

from tracker.io.read.detections.pictured import PicturedBoxes
from tracker.io.read.pieces import Piece
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import SourceFile, camera_of, number_in
from tracker.io.read.values import is_list_of_tables, numbers, tables

NAME = "Label Studio JSON"
KIND: Kind = "detections"
SERIES = False

_SIDES = ("x", "y", "width", "height")
_LABELS = ("rectanglelabels", "labels", "brushlabels")
_MOST_BETWEEN = 1_000_000
"""Frames of one person's key frames: numbers of a damaged file are not counted through."""


class _Box(NamedTuple):
    frame: int
    sides: tuple[float, ...]
    """Percents."""
    label: str


def recognise(file: SourceFile) -> Certainty:
    """A list of tasks with rectangles in percents and the size of their picture."""
    head = file.head_text
    if head.lstrip()[:1] != "[" or not any(f'"{name}"' in head for name in _LABELS):
        return Certainty.NO
    is_it = '"original_width"' in head or '"videorectangle"' in head or '"sequence"' in head
    return Certainty.SURE if is_it else Certainty.NO


def read(file: SourceFile) -> Iterator[Piece]:
    """A piece a camera, which is what the names of pictures begin with, or a video."""
    found = PicturedBoxes(file, NAME, "ltwh", parts=True)
    for place, task in enumerate(tables(file, "", file.json)):
        name = _source(task)
        results = list(_results(task))
        is_video = any("sequence" in _value(one) for one in results)
        camera = name.rsplit("/", 1)[-1].rsplit(".", 1)[0] if is_video else camera_of(name)
        frame = place if (number := number_in(name)) is None else number
        first: Literal[1] | None = 1 if is_video else None
        found.look_at(camera, first or frame, first)
        for n, one in enumerate(results):
            found.sized(one.get("original_width"), one.get("original_height"))
            for box in _boxes(file, f"task {place} result {n}", one, frame):
                found.look_at(camera, box.frame, first)
                found.add([side / 100.0 for side in box.sides], box.label)
    yield from found.pieces()


def _source(task: dict[str, Any]) -> str:
    """The picture or the video, without what the server puts before its name."""
    data = task.get("data", task)
    fields = data if isinstance(data, dict) else {}
    texts = [str(fields[key]) for key in ("image", "img", "video", "video_url") if key in fields]
    texts += [own for own in fields.values() if isinstance(own, str) and "/" in own]
    name = (texts or [""])[0].split("?d=")[-1]
    folder, _, own = name.rpartition("/")
    start, dash, rest = own.partition("-")
    uploaded = dash and len(start) == 8 and all(sign in "0123456789abcdef" for sign in start)
    if "/upload/" in f"{folder}/" or "local-files" in name:
        folder = ""  # of the server, not of the camera
    return f"{folder}/{rest if uploaded else own}".lstrip("/")


def _results(task: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """The results of the first annotation that is not cancelled, else of a prediction."""
    for part in ("annotations", "completions", "predictions"):
        for one in task.get(part, ()) if isinstance(task.get(part), list) else ():
            if isinstance(one, dict) and not one.get("was_cancelled") and one.get("result"):
                yield from (r for r in one["result"] if isinstance(r, dict))
                return
    for value in task.values():  # JSON-MIN
        if is_list_of_tables(value):
            yield from (one for one in value if "original_width" in one or "sequence" in one)


def _value(result: dict[str, Any]) -> dict[str, Any]:
    value = result.get("value", result)
    return value if isinstance(value, dict) else {}


def _boxes(file: SourceFile, where: str, result: dict[str, Any], frame: int) -> Iterator[_Box]:
    """One rectangle of a picture, or those of a video at every frame."""
    value = _value(result)
    label = next((str(value[name][0]) for name in _LABELS if value.get(name)), "")
    if "sequence" in value:
        keys = tables(file, f"{where} sequence", value["sequence"])
        rows = [numbers(file, f"{where} key frame", [k.get(n) for n in ("frame", *_SIDES)])
                for k in keys]  # fmt: skip
        order = sorted(range(len(rows)), key=lambda n: rows[n][0])
        for n, after in pairwise([*order, -1]):
            first = int(rows[n][0])
            last = max(int(rows[after][0]), first + 1) if after >= 0 else first + 1
            if last - first > _MOST_BETWEEN:
                raise file.error(f"expected key frames nearer than {last - first}", where)
            between = range(first, last if keys[n].get("enabled", True) else first + 1)
            for own in between:
                part = (own - first) / (last - first)
                end = rows[after] if after >= 0 else rows[n]
                yield _Box(own, tuple(((1.0 - part) * rows[n] + part * end)[1:]), label)
    elif all(side in value for side in _SIDES):
        sides = numbers(file, where, [value[side] for side in _SIDES])
        yield _Box(frame, tuple(sides), label)
