"""The meaning of a table's columns by their names: frame, box, score, person, place.

Shared by CSV and JSON of detectors, of annotation programs and of one's own scripts. The
four numbers of a box are told apart by the names (``x2`` is no width); where there is but a
list of four, the layout stays open.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.files.text import shown
from tracker.io.read.pieces import DetectionPiece, Layout, Piece, TruthPiece, unit_named
from tracker.io.read.source import SourceFile, camera_of, number_in
from tracker.io.read.values import plain

WORDS: dict[str, tuple[str, ...]] = {
    "frame": ("frame", "frameid", "frameindex", "framenumber", "frameno", "frameidx", "framenr",
              "imageid", "imgid", "step", "image", "imagename", "filename", "file", "framename",
              "imageindex", "imagepath", "imgpath", "filepath", "path", "imgname", "imagefile"),
    "time": ("time", "timestamp", "seconds", "sec", "times", "t", "timesec", "timems",
             "timestampms", "timecode"),
    "camera": ("camera", "cam", "cameraid", "camid", "view", "cameraname", "viewid", "viewnum"),
    "left": ("left", "xmin", "x1", "bbleft", "bboxleft", "xtl", "l", "bboxx1", "boxx1", "minx",
             "bboxxmin", "x0"),
    "top": ("top", "ymin", "y1", "bbtop", "bboxtop", "ytl", "bboxy1", "boxy1", "miny",
            "bboxymin", "y0"),
    "right": ("right", "xmax", "x2", "bbright", "xbr", "r", "bboxx2", "boxx2", "maxx", "bboxxmax"),
    "bottom": ("bottom", "ymax", "y2", "bbbottom", "ybr", "b", "bboxy2", "boxy2", "maxy",
               "bboxymax"),
    "width": ("width", "w", "bbwidth", "bboxwidth", "boxwidth", "bboxw", "bw"),
    "height": ("height", "h", "bbheight", "bboxheight", "boxheight", "bboxh", "bh"),
    "cx": ("cx", "xcenter", "xcentre", "xc", "centerx", "centrex"),
    "cy": ("cy", "ycenter", "ycentre", "yc", "centery", "centrey"),
    "box": ("bbox", "box", "xyxy", "xywh", "tlwh", "ltwh", "boundingbox"),
    "score": ("score", "confidence", "conf", "prob", "probability", "detectionscore",
              "bboxscore"),
    "class": ("class", "classname", "label", "name", "category", "classid", "categoryid",
              "prediction"),
    "id": ("id", "trackid", "trackerid", "personid", "objectid", "identity", "targetid", "person",
           "pid"),
    "x": ("x", "xm", "worldx", "xworld", "px", "posx", "positionx", "xmm", "xcm"),
    "y": ("y", "ym", "worldy", "yworld", "py", "posy", "positiony", "ymm", "ycm"),
    "z": ("z", "zm", "worldz", "zworld", "pz", "posz", "positionz", "zmm", "zcm"),
    "place": ("position", "pos", "place", "location", "xyz", "xy", "worldposition", "position3d",
              "location3d", "coordinates", "worldcoordinates", "floorposition"),
    "valid": ("valid",),
}  # fmt: skip
"""Names, without case, blanks and underscores, of each meaning; the first that is there counts."""

PEOPLE = ("person", "people", "pedestrian", "human", "man", "woman", "player")
"""Names of classes that are people."""

_FIRST_CLASSES = ("0", "1")
"""The numbers of people among the classes of YOLO and of COCO."""

_LISTED = 4
"""Classes that a sentence names."""

_OURS = "existence"
"""A column of the track files that this program writes, which are no one's truth."""

_LONGEST = 1e6
"""Seconds: larger numbers are not times since a recording began."""

_FRACTIONS = 0.4
"""Share of numbers of frames that are not whole above which they are seconds: of two frames a
second every other one is whole."""

_SELDOM = 5.0
"""Seconds between two pictures of a recording that are more likely milliseconds."""

_DATED = (5e8, 5e9)
"""Seconds since the beginning of 1970 that are dates, of the years 1985 to 2128."""

_PARTS_OF_SECONDS = (1.0, 1e3, 1e6, 1e9)
"""How many of its units a second has in which dates are counted."""

_LONGEST_BOX = 8
"""Numbers of a box that is a list: the four, a score, a class, a track, and one to spare."""

_DECIMAL_COMMA = re.compile(r"[-+]?\d+,\d+(e[-+]?\d+)?", re.IGNORECASE)

Column = Sequence[Any]


def decimal_point(cell: str) -> str:
    """A number with a decimal comma as one with a point; any other cell as it is."""
    return cell.replace(",", ".") if _DECIMAL_COMMA.fullmatch(cell.strip()) else cell


def delimiter_of(line: str) -> str:
    """The sign between the cells of a row: of comma, semicolon and tab the most frequent one."""
    return max(",;\t", key=line.count)


def decimal_points(line: str) -> str:
    """A row with blanks between its cells, decimal commas as points; any other row as it is."""
    words = line.split() if "," in line else []
    if len(words) < 3 or not all("," not in w or _DECIMAL_COMMA.fullmatch(w) for w in words):
        return line
    return line.replace(",", ".")


def meanings(names: Sequence[str]) -> dict[str, str]:
    """The column of each meaning: the one whose name stands first in :data:`WORDS`."""
    found: dict[str, str] = {}
    by_word = {plain(name): name for name in reversed(names)}
    for meaning, words in WORDS.items():
        for word in words:
            if word in by_word:
                found[meaning] = by_word[word]
                break
    return found


def layout_of(found: Mapping[str, str]) -> tuple[Layout | None, tuple[str, ...]] | None:
    """The layout of the box, and the meanings of its columns; None where there is no box.

    Under x and y some programs write the left and upper edges, others the middle (Roboflow,
    Ultralytics' ``xywh``): their layout stays open.
    """
    forms: tuple[tuple[Layout | None, tuple[str, ...]], ...] = (
        ("ltwh", ("left", "top", "width", "height")),
        ("xyxy", ("left", "top", "right", "bottom")),
        ("cxcywh", ("cx", "cy", "width", "height")),
        (None, ("x", "y", "width", "height")),
    )
    for layout, parts in forms:
        if all(part in found for part in parts):
            return layout, parts
    return None


def is_table(names: Sequence[str]) -> bool:
    """Whether the columns are those of boxes or of places of people."""
    if _OURS in names:
        return False
    found = meanings(names)
    when = "frame" in found or "time" in found
    placed = "place" in found or ("x" in found and "y" in found)
    has_boxes = "box" in found or layout_of(found) is not None
    return has_boxes or (when and "id" in found and placed)


def singular(name: str) -> str:
    """The name of a column, that of a list with an ending as ``boxes`` without it."""
    own = plain(name)
    endings = (own, own.removesuffix("s"), own.removesuffix("es"))
    return next((word for word in endings if meanings([word])), name)


def _with_places(file: SourceFile, columns: Mapping[str, Column]) -> Mapping[str, Column]:
    """Return the columns with places that are lists of two or three numbers as x, y, z.

    Raises:
        FormatError: If they are anything else.
    """
    found = meanings(list(columns))
    if "place" not in found or "x" in found or layout_of(found) is not None or "box" in found:
        return columns
    name = found["place"]
    try:
        values = np.asarray(columns[name], dtype=float)
    except (ValueError, TypeError):
        values = np.zeros(0)
    if values.ndim != 2 or values.shape[1] not in (2, 3):
        raise file.error("expected two or three numbers of a place in every row", name)
    axes: dict[str, Column] = dict(zip("xyz", values.T.tolist(), strict=False))
    return {**{key: cells for key, cells in columns.items() if key != name}, **axes}


def read_table(
    file: SourceFile,
    name: str,
    columns: Mapping[str, Column],
) -> Iterator[Piece]:
    """The boxes, a piece a camera, or the truth that a table holds.

    Args:
        file: For the messages.
        name: The format, as it is shown.
        columns: Cells by column, as text or numbers.

    Raises:
        FormatError: If there is no frame, or a cell is no number.
    """
    columns = _with_places(file, columns)
    columns, left_out = _with_frames(file, columns)
    for piece in _pieces(file, name, columns):
        yield replace(piece, left_out=" ".join(filter(None, (left_out, piece.left_out))))


def _pieces(
    file: SourceFile,
    name: str,
    columns: Mapping[str, Column],
) -> Iterator[DetectionPiece | TruthPiece]:
    found = meanings(list(columns))
    when = RowTimes()
    if "frame" not in found and "time" in found:
        column = found["time"]
        times = _numbers(file, column, [_seconds(cell) for cell in columns[column]])
        if not np.isfinite(times).all():
            raise file.error("expected a time in every row", column)
        try:
            frames, when = frames_of_times(times, plain(column).endswith("ms"))
        except ValueError as error:
            raise file.error(str(error), column) from None
    elif "frame" not in found:
        raise file.error(
            'expected a column "frame" (or a number in the name of a file a frame), found the '
            f"columns {shown(', '.join(columns))}"
        )
    else:
        frames = _numbers_in(columns[found["frame"]]).astype(np.int64)
    form = layout_of(found)
    if form is None and "box" in found:
        values, more = _fours(file, found["box"], columns[found["box"]], frames)
        new = {meaning: cells for meaning, cells in more.items() if meaning not in found}
        columns, found = {**columns, **new}, {**{meaning: meaning for meaning in new}, **found}
        yield from _detections(file, name, columns, found, frames, values, None, when)
    elif form is not None:
        layout, parts = form
        values = np.column_stack([_numbers(file, found[p], columns[found[p]]) for p in parts])
        yield from _detections(file, name, columns, found, frames, values, layout, when)
    else:
        yield _truth(file, name, columns, found, frames, when)


def to_unit(scores: Float[ndarray, " D"]) -> Float[ndarray, " D"]:
    """Scores as parts of 1: logits through the logistic function, percents divided."""
    if len(scores) == 0 or (scores.min() >= 0.0 and scores.max() <= 1.0):
        return scores
    if (scores == -1.0).all():  # "none"
        return np.ones(len(scores))
    if scores.min() >= 0.0:
        return scores / max(float(scores.max()), 100.0 if scores.max() <= 100.0 else 0.0)
    return np.asarray(1.0 / (1.0 + np.exp(-np.clip(scores, -50.0, 50.0))))


def is_normalised(boxes: Float[ndarray, "D 4"]) -> bool:
    """Whether the numbers are parts of the picture: no box of pixels is that small.

    A few may be larger: some detectors draw people on beyond the picture.
    """
    return len(boxes) > 0 and bool(np.quantile(np.abs(boxes), 0.9) <= 1.5)


def _detections(
    file: SourceFile,
    name: str,
    columns: Mapping[str, Column],
    found: Mapping[str, str],
    frames: Int[ndarray, " D"],
    boxes: Float[ndarray, "D 4"],
    layout: Layout | None,
    when: RowTimes,
) -> Iterator[DetectionPiece]:
    scores = np.ones(len(frames))
    if "score" in found:
        scores = _numbers(file, found["score"], columns[found["score"]], blank=1.0)
    boxes = np.where(np.isfinite(scores)[:, None], boxes, np.nan)
    if "score" in found:
        scores = to_unit(np.where(np.isfinite(scores), scores, 0.0))
    classes = np.full(len(frames), "", dtype=object)
    wanted = np.ones(len(frames), dtype=bool)
    if "class" in found:
        classes[:] = [str(cell) for cell in columns[found["class"]]]
        wanted = people(classes.tolist())
    keep = wanted & np.isfinite(boxes).all(axis=1)
    cameras = np.array(_cameras(columns, found, len(frames)))
    for camera in dict.fromkeys(cameras[keep].tolist()) or [""]:
        rows = (cameras == camera) | (not keep.any())
        piece = DetectionPiece(
            source=file.path,
            format=name,
            camera=str(camera),
            frames=frames[rows],
            boxes=boxes[rows],
            scores=scores[rows],
            layout=layout,
            normalised=is_normalised(boxes[rows & keep]),
            first_index=None if when.fps is None else 0,
            last_frame=int(frames.max()) if len(frames) else None,
            fps=when.fps,
            begins=when.begins,
        )
        yield only_people(file, piece, classes[rows].tolist(), wanted[rows])


def _cameras(columns: Mapping[str, Column], found: Mapping[str, str], rows: int) -> list[str]:
    """Of each row: by its column, or by what the names of its pictures have before the frame."""
    if "camera" in found:
        return [str(cell) for cell in columns[found["camera"]]]
    pictures = columns[found["frame"]] if "frame" in found else ()
    if pictures and isinstance(pictures[0], str) and number_in(pictures[0]) is not None:
        named = [camera_of(str(cell)) for cell in pictures]
        if len(set(named)) > 1:
            return named
    return [""] * rows


def only_people(
    file: SourceFile,
    piece: DetectionPiece,
    classes: Sequence[str],
    wanted: Bool[ndarray, " D"] | None = None,
) -> DetectionPiece:
    """The boxes of a piece that are people's, with a sentence about the others.

    Args:
        file: The file, for the sentence.
        piece: All boxes of a camera; a row without a box has NaN.
        classes: The class of each row.
        wanted: Whether each row's class is people, if other cameras tell that, too.
    """
    is_box = np.isfinite(piece.boxes).all(axis=1)
    keep = (people(classes) if wanted is None else wanted) & is_box
    if keep.all():
        return piece
    others = [
        one if there else "without a box"
        for one, kept, there in zip(classes, keep, is_box, strict=True)
        if not kept
    ]
    return replace(
        piece,
        frames=piece.frames[keep],
        boxes=piece.boxes[keep],
        scores=piece.scores[keep],
        keypoints=None if piece.keypoints is None else piece.keypoints[keep],
        left_out=no_people(file, others, len(keep)),
    )


def no_people(file: SourceFile, others: Sequence[str], rows: int) -> str:
    """Describe the rows of a file that are left out, since they are no boxes of people.

    Args:
        file: The file.
        others: What each of these rows is of.
        rows: The number of all rows.
    """
    counts = Counter(others)
    listed = ", ".join(f"{count} {name}".strip() for name, count in counts.most_common(_LISTED))
    return (
        f"{file.where}: {len(others)} of {rows} rows ({100 * len(others) / rows:.0f} %) are left "
        f"out, which are no boxes of people ({listed}{' …' if len(counts) > _LISTED else ''})"
    )


def people(classes: Sequence[str]) -> Bool[ndarray, " D"]:
    """Which rows are people: by a class's name; numbers count where no name is known.

    A single class other than those is taken for people whatever it is called.
    """
    words = [re.sub(r"\.0$", "", word.strip().lower()) for word in classes]
    for group in (PEOPLE, *((number,) for number in _FIRST_CLASSES)):
        is_one = np.array([word in group for word in words], dtype=bool)
        if is_one.any():
            return is_one
    return np.full(len(words), len(set(words)) <= 1)


def _truth(
    file: SourceFile,
    name: str,
    columns: Mapping[str, Column],
    found: Mapping[str, str],
    frames: Int[ndarray, " G"],
    when: RowTimes,
) -> TruthPiece:
    axes = [axis for axis in "xyz" if axis in found]
    places = np.full((len(frames), 3), np.nan)
    for axis in axes:
        places[:, "xyz".index(axis)] = _numbers(file, found[axis], columns[found[axis]])
    ids = _whole_or_names(columns[found["id"]])
    valid = None
    if "valid" in found:
        valid = _numbers(file, found["valid"], columns[found["valid"]]) > 0.5
    good = np.isfinite(places[:, :2]).all(axis=1)
    return TruthPiece(
        source=file.path,
        format=f"{name}: places",
        frames=frames[good],
        ids=ids[good],
        positions=places[good],
        unit=unit_named(plain(found["x"])[-2:]),
        valid=None if valid is None else valid[good],
        fps=when.fps,
        begins=when.begins,
        first_index=None if when.fps is None else 0,
    )


def _with_frames(
    file: SourceFile, columns: Mapping[str, Column]
) -> tuple[Mapping[str, Column], str]:
    """Return the rows that have the whole number of a frame, and a sentence about the others.

    Where most numbers are not whole they are times, and their column is called so.

    Raises:
        FormatError: If half of the rows have no frame.
    """
    name = meanings(list(columns)).get("frame")
    if name is None:
        return columns, ""
    numbers = _numbers_in(columns[name])
    whole = (numbers == np.round(numbers)) & (np.abs(numbers) < 2**53)
    rows, out = len(whole), int((~whole).sum())
    if not out:
        return columns, ""
    own = np.unique(numbers)
    if len(own) > 1 and np.isfinite(own).all() and (own % 1.0 > 0.0).mean() > _FRACTIONS:
        named = {key: cells for key, cells in columns.items() if key != name}
        return named if "time" in meanings(list(named)) else {**named, "time": columns[name]}, ""
    row = int(np.argmin(whole))
    words = f"row {row + 1}: expected the whole number of a frame, found"
    if 2 * out >= rows:
        raise file.error(f"{words} {shown(columns[name][row])}", name)
    kept = {
        key: [cells[k] for k in np.flatnonzero(whole).tolist()] for key, cells in columns.items()
    }
    return kept, (
        f"{file.where}, {name}: {out} of {rows} rows ({100 * out / rows:.2f} %) are left out, the "
        f"first in {words} {shown(columns[name][row])}"
    )


def _numbers_in(cells: Column) -> Float[ndarray, " D"]:
    """The number of each cell or of the name in it; NaN if there is none."""
    try:
        return np.asarray(cells, dtype=float)
    except (ValueError, TypeError, OverflowError):
        return np.array([_number_of(cell) for cell in cells])


def _number_of(cell: Any) -> float:
    try:
        return float(cell)
    except (ValueError, TypeError, OverflowError):
        number = number_in(str(cell))
    return np.nan if number is None else float(number)


class RowTimes(NamedTuple):
    """What a column of times says of frames."""

    fps: float | None = None
    """How many frames there are a second; None if there are no times."""
    begins: float | None = None
    """The time of frame 0 since the beginning of 1970, seconds; None if there are no dates."""


def frames_of_times(
    times: Float[ndarray, " D"], milliseconds: bool = False
) -> tuple[Int[ndarray, " D"], RowTimes]:
    """Frames that are as far apart as the times, counted from time 0 or the first of dates.

    Times are seconds, or milliseconds where whole numbers would be :data:`_SELDOM` apart; since the
    beginning of 1970 they may be in milli-, micro- or nanoseconds too. The rate that fits all of
    them is taken: times are rounded, and where nobody was seen there are none.

    Args:
        times: The finite time of each row.
        milliseconds: Whether it is known that they are milliseconds.

    Raises:
        ValueError: With what was expected and found, if they are no times of a recording.
    """
    apart = np.diff(np.unique(times))
    seldom = len(apart) > 0 and float(np.median(apart)) >= _SELDOM and not (times % 1.0).any()
    seconds = times * (1e-3 if seldom or milliseconds else 1.0)
    first = float(times.min(initial=np.inf))
    parts = parts_of_date(first)
    if parts is not None:
        seconds = (times - first) / parts
    own = np.unique(seconds)
    if len(own) < 2 or own[0] < 0.0 or own[-1] > _LONGEST:
        raise ValueError(
            f"expected two or more times from 0 to {_LONGEST:g} s since the beginning, or with "
            f'dates, found {own[0]:g} … {own[-1]:g} s; have a column "frame" instead'
            if len(own)
            else "expected times, found none"
        )
    apart = np.diff(own)
    steps = np.round(apart / np.median(apart))
    fps = float(round(steps.sum() / apart[steps > 0].sum(), 3))
    begins = None if parts is None else first / parts
    return np.round(seconds * fps).astype(np.int64), RowTimes(fps, begins)


def parts_of_date(time: float) -> float | None:
    """How many of its units a second has if a number is a date; None if it is none."""
    return next((p for p in _PARTS_OF_SECONDS if _DATED[0] < time / p < _DATED[1]), None)


def _seconds(cell: Any) -> Any:
    """A time of day (``00:01:02.5``) or a date with a time (ISO 8601) as seconds, the latter since
    the beginning of 1970; anything else as it is."""
    words = str(cell).strip()
    parts = re.fullmatch(r"(?:(\d+):)?(\d+):(\d+(?:[.,]\d*)?)", words)
    if parts is not None:
        hours, minutes, seconds = parts.groups(default="0")
        return 3600.0 * float(hours) + 60.0 * float(minutes) + float(seconds.replace(",", "."))
    if not re.match(r"\d{4}-?\d\d-?\d\d[T ]", words):
        return cell
    try:
        date = datetime.fromisoformat(words)
    except ValueError:
        return cell
    return (date if date.tzinfo else date.replace(tzinfo=UTC)).timestamp()


def _numbers(
    file: SourceFile, name: str, cells: Column, blank: float = np.nan
) -> Float[ndarray, " D"]:
    try:
        return np.asarray([blank if c is None or c == "" else c for c in cells], dtype=float)
    except (ValueError, TypeError):
        for row, cell in enumerate(cells):
            try:
                float(cell if cell not in (None, "") else blank)
            except (ValueError, TypeError):
                raise file.error(
                    f"row {row + 1}: expected a number, found {shown(cell)}", name
                ) from None
        raise


def _fours(
    file: SourceFile, name: str, cells: Column, frames: Int[ndarray, " D"]
) -> tuple[Float[ndarray, "D 4"], dict[str, Column]]:
    """Boxes that are lists of four numbers; and the score and class that may follow these.

    A whole number that two rows of a frame share is no person's, so it is a class; of what
    follows, the first column that is not whole is the score.
    """
    lengths = {len(cell) if isinstance(cell, list | tuple) else 0 for cell in cells}
    lists: Column = cells
    if lengths == {1}:  # [[left, top, …]], as mmpose writes them
        lists = [cell[0] for cell in cells]
    try:
        values = np.asarray(list(lists), dtype=float)
    except (ValueError, TypeError):
        raise file.error("expected lists of four numbers", name) from None
    if not len(values):
        return np.zeros((0, 4)), {}
    if values.ndim != 2 or not 4 <= values.shape[1] <= _LONGEST_BOX:
        raise file.error("expected lists of four numbers, or with score and class", name)
    more: dict[str, Column] = {}
    for column in values[:, 4:].T:
        parts = bool(((column >= 0.0) & (column <= 1.0)).all())
        if "score" not in more and parts and (values.shape[1] == 5 or (column % 1.0).any()):
            more["score"] = column
        elif "score" in more and not (column % 1.0).any():
            if len(np.unique(np.stack([frames, column]), axis=1).T) < len(column):
                more.setdefault("class", column)
    return values[:, :4], more


def _whole_or_names(cells: Column) -> Int[ndarray, " G"]:
    """Persons as whole numbers: as they are, or counted in the order of their first row."""
    try:
        values = np.asarray(cells, dtype=float)
        if (values == np.round(values)).all() and (np.abs(values) < 2**53).all():
            return values.astype(np.int64)
    except (ValueError, TypeError):
        pass
    order = {name: place for place, name in enumerate(dict.fromkeys(map(str, cells)), 1)}
    return np.array([order[str(cell)] for cell in cells], dtype=np.int64)
