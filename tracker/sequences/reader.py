"""A folder with a ``sequence.toml`` → a checked :class:`Sequence`.

Whatever is wrong is told in one sentence that names the file, the line or the field,
what was expected and what was found. What is odd but can be lived with becomes one of
``Sequence.warnings``.
"""

from __future__ import annotations

import hashlib
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from tracker.sequences.calibration import POSE, check_sight, read_camera
from tracker.sequences.csv_columns import Columns, read_columns
from tracker.sequences.fields import Fields, did_you_mean, shown
from tracker.sequences.media import check_pictures, find_images, locate
from tracker.sequences.sequence import (
    Detections,
    GroundTruth,
    Sequence,
    SequenceError,
    View,
)
from tracker.sequences.writing.taught_fields import read_room, read_templates

FILE = "sequence.toml"
FORMAT = 1
MOST_FRAMES = 10_000_000

TOP = ("format", "name", "description", "fps", "frames", "room", "target", "camera", "template",
       "ground_truth")  # fmt: skip
CAMERA = ("name", "image_size", "video", "images", "first_frame", "detections", *POSE, "projection")


@dataclass(frozen=True, slots=True)
class SequenceSummary:
    """What a list of sequences shows of one, read without opening its videos and tables."""

    name: str
    description: str
    fps: float
    frames: int
    cameras: int


@dataclass(slots=True)
class _Reading:
    """What is collected on the way through the file."""

    folder: Path
    frames: int
    files: list[Path] = field(default_factory=list)
    """Every file that sequence.toml names, in its order."""
    warnings: list[str] = field(default_factory=list)


def read_sequence(folder: Path | str) -> Sequence:
    """Read and check a sequence folder.

    Args:
        folder: The folder, or the ``sequence.toml`` in it.

    Raises:
        SequenceError: In one sentence: file, line or field, expected, found, what to do.
    """
    folder, text = _find(Path(folder))
    fields = _parse(folder, text)
    reading = _Reading(folder, fields.integer("frames", minimum=1, maximum=MOST_FRAMES))
    fps = fields.number("fps", above=0.0, at_most=1000.0)
    room = read_room(fields)
    target = fields.table("target", ("half_extents",))
    assert target is not None
    half_extents = target.vector(
        "half_extents", 3, "half width, depth and height in metres", positive=True
    )
    views = _views(fields, reading)
    for view in views:
        reading.warnings += check_sight(view.camera, room)
    templates = read_templates(fields, views, reading.frames)
    ground_truth = _ground_truth(fields, reading)
    return Sequence(
        name=fields.text("name"),
        folder=folder,
        fps=fps,
        frames=reading.frames,
        room=room,
        target_half_extents=half_extents,
        views=views,
        description=fields.text("description", ""),
        templates=templates,
        ground_truth=ground_truth,
        digest=_digest(text, reading),
        warnings=tuple(reading.warnings),
    )


def read_summary(folder: Path | str) -> SequenceSummary:
    """Read the head of a sequence's file only, quickly.

    Raises:
        SequenceError: As :func:`read_sequence`, for the fields it reads.
    """
    folder, text = _find(Path(folder))
    fields = _parse(folder, text)
    return SequenceSummary(
        name=fields.text("name"),
        description=fields.text("description", ""),
        fps=fields.number("fps", above=0.0, at_most=1000.0),
        frames=fields.integer("frames", minimum=1, maximum=MOST_FRAMES),
        cameras=len(fields.tables("camera", CAMERA, "[[camera]]")),
    )


def _find(folder: Path) -> tuple[Path, str]:
    """The folder and the text of its sequence.toml."""
    if folder.name == FILE and folder.is_file():
        folder = folder.parent
    try:
        if not folder.exists():
            near = did_you_mean(folder.name, _names(folder.parent))
            raise SequenceError(f"{folder}: there is no such folder{near}")
        if not folder.is_dir():
            raise SequenceError(f"{folder}: expected a folder with a {FILE} in it, found a file")
        folder = folder.resolve()
        if not (folder / FILE).is_file():
            near = did_you_mean(FILE, _names(folder)) or f"; every sequence folder needs a {FILE}"
            raise SequenceError(f"{folder}: there is no {FILE} in this folder{near}")
        return folder, (folder / FILE).read_text(encoding="utf-8-sig")
    except OSError as error:
        raise SequenceError(
            f"{folder}: cannot be read ({error.strerror}); check its permissions"
        ) from None
    except UnicodeDecodeError as error:
        line = error.object.count(b"\n", 0, error.start) + 1
        raise SequenceError(
            f"{folder.name}/{FILE}, line {line}: expected text in UTF-8, found byte "
            f"0x{error.object[error.start]:02x}; save the file as UTF-8"
        ) from None


def _names(folder: Path) -> list[str]:
    return [path.name for path in folder.iterdir()] if folder.is_dir() else []


def _parse(folder: Path, text: str) -> Fields:
    where = f"{folder.name}/{FILE}"
    try:
        values = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        problem, _, place = str(error).removesuffix(")").rpartition(" (at ")
        if place == "end of document":
            place = f"line {len(text.splitlines())}"
        raise SequenceError(f"{where}, {place}: is not valid TOML: {problem.lower()}") from None
    version = values.get("format", FORMAT)
    if version != FORMAT:
        raise SequenceError(
            f"{where}, format: expected {FORMAT}, the only format this program reads, "
            f"found {shown(version)}"
        )
    fields = Fields(where, values, TOP)
    fields.integer("format", minimum=FORMAT, maximum=FORMAT)
    return fields


def _views(fields: Fields, reading: _Reading) -> tuple[View, ...]:
    tables = fields.tables("camera", CAMERA, "[[camera]]")
    if not tables:
        raise fields.error("camera", "expected at least one table [[camera]], found none")
    views: list[View] = []
    for camera in tables:
        name = camera.text("name")
        if any(character in name for character in ',"#'):
            raise camera.error(
                "name", f"expected no comma, quote or # (it heads CSV columns), found {shown(name)}"
            )
        if name in [view.camera.name for view in views]:
            raise camera.error("name", "two cameras have this name; rename one of them")
        views.append(_view(name, camera, reading))
    return tuple(views)


def _view(name: str, fields: Fields, reading: _Reading) -> View:
    size = fields.vector("image_size", 2, "width and height in pixels", positive=True)
    if (size != np.floor(size)).any() or (size > 65535).any():
        found = f"{size[0]:g} and {size[1]:g}"
        raise fields.error(
            "image_size", f"expected two whole numbers of pixels up to 65535, found {found}"
        )
    image_size = (int(size[0]), int(size[1]))
    if "video" in fields and "images" in fields:
        raise fields.error("images", "expected a video or images, found both; remove one")
    video = None
    if "video" in fields:
        video = locate(reading.folder, fields, "video")
    images = find_images(reading.folder, fields) if "images" in fields else ()
    detections = None
    if "detections" in fields:
        path = locate(reading.folder, fields, "detections")
        detections = _detections(path, reading)
    view = View(
        camera=read_camera(name, image_size, fields),
        video=video,
        images=images,
        first_frame=fields.integer("first_frame", 0),
        detections=detections,
    )
    reading.warnings += check_pictures(view, fields, reading.frames)
    reading.files += images if video is None else (video,)
    return view


def _detections(path: Path, reading: _Reading) -> Detections:
    columns = _columns(
        path,
        reading,
        needed=("frame", "left", "top", "width", "height"),
        optional={"score": 1.0},
    )
    frames = columns.whole("frame", 0, reading.frames - 1, "the step")
    for name in ("width", "height"):
        columns.require(name, columns.values[name] > 0.0, "a size above 0 pixels")
    scores = columns.values["score"]
    columns.require("score", (scores >= 0.0) & (scores <= 1.0), "a score from 0 to 1")
    order = np.argsort(frames, kind="stable")
    boxes = columns.stacked("left", "top", "width", "height")
    return Detections(frames[order], boxes[order], scores[order])


def _columns(
    path: Path, reading: _Reading, *, needed: tuple[str, ...], optional: Mapping[str, float]
) -> Columns:
    reading.files.append(path)
    where = f"{reading.folder.name}/{path.relative_to(reading.folder).as_posix()}"
    return read_columns(path, where, needed=needed, optional=optional)


def _ground_truth(fields: Fields, reading: _Reading) -> GroundTruth | None:
    table = fields.table("ground_truth", ("file",), needed=False)
    if table is None:
        return None
    path = locate(reading.folder, table, "file")
    columns = _columns(
        path,
        reading,
        needed=("frame", "id", "x", "y", "z"),
        optional={"valid": 1.0},
    )
    frames = columns.whole("frame", 0, reading.frames - 1, "the step")
    ids = columns.whole("id", 0, None, "the person")
    valid = columns.whole("valid", 0, 1, "1 certain, 0 not")
    order = columns.one_row_each(frames, ids, "person")
    positions = columns.stacked("x", "y", "z")
    return GroundTruth(frames[order], ids[order], positions[order], valid[order] == 1)


def _digest(text: str, reading: _Reading) -> str:
    digest = hashlib.sha256(text.encode())
    for path in reading.files:
        status = path.stat()
        name = path.relative_to(reading.folder).as_posix()
        digest.update(f"{name} {status.st_size} {status.st_mtime_ns}\n".encode())
    return digest.hexdigest()[:16]
