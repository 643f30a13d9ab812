"""The tables ``[[camera]]`` of a sequence: files, clocks and calibration of the cameras."""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Sequence as Many
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Bool
from numpy import ndarray

from tracker.files.text import shown
from tracker.geometry.calibration import (
    check_focal_lengths,
    checked_distortion,
    checked_intrinsics,
    checked_rotation,
    checked_size,
    size_around,
)
from tracker.geometry.camera import Camera
from tracker.sequences.clock import FIELDS, Timing, read_timing
from tracker.sequences.errors import SequenceError
from tracker.sequences.fields import LARGEST, Fields, listed
from tracker.sequences.pictures.containers import MOST_PIXELS
from tracker.sequences.pictures.media import (
    PictureProperties,
    check_pictures,
    check_size,
    find_images,
    locate,
    probe,
)
from tracker.sequences.pictures.video import read_image, why_no_picture
from tracker.sequences.sequence import Room, View
from tracker.sequences.tables import BoxTable, OpenedFiles, read_box_table

POSE = ("K", "distortion", "lens", "R", "t")
"""The fields of a calibration without ``projection``."""


def read_camera(name: str, image_size: tuple[int, int], fields: Fields) -> Camera:
    """Read the calibration of one ``[[camera]]`` table.

    Args:
        name: The camera's name.
        image_size: Width and height of its pictures, pixels.
        fields: The table.

    Raises:
        SequenceError: If the calibration is incomplete, of the wrong shape, or impossible.
    """
    if "projection" in fields:
        both = [key for key in POSE if key in fields]
        if both:
            raise fields.error(
                "projection", f"stands in place of {listed(both)}; remove one or the other"
            )
        projection = fields.matrix("projection", 3, 4)
        try:
            with np.errstate(all="ignore"):
                camera = Camera.from_projection(name, image_size, projection)
        except ValueError as error:
            raise fields.error("projection", str(error)) from None
        fields.checked("projection", check_focal_lengths, camera.intrinsics)
        if not np.abs(camera.translation).max() <= LARGEST:
            raise fields.error(
                "projection",
                f"expected a camera within {LARGEST:g} m of the origin, found one at "
                f"{np.abs(camera.translation).max():.4g} m",
            )
        return camera
    missing = [key for key in ("K", "R", "t") if key not in fields]
    if missing:
        raise SequenceError(
            f"{fields.where}: the calibration is incomplete: expected K, R and t, or projection; "
            f"{listed(missing)} {'is' if len(missing) == 1 else 'are'} missing"
        )
    lens = fields.text("lens", "plain")
    if lens not in ("plain", "fisheye"):
        raise fields.error("lens", f'expected "plain" or "fisheye", found {shown(lens)}')
    intrinsics = fields.checked("K", checked_intrinsics, fields.matrix("K", 3, 3))
    fields.checked("K", check_focal_lengths, intrinsics)
    distortion, _ = fields.checked(
        "distortion", checked_distortion, fields.numbers("distortion"), fisheye=lens == "fisheye"
    )
    return Camera(
        name,
        image_size,
        intrinsics,
        fields.checked("R", checked_rotation, fields.matrix("R", 3, 3)),
        fields.vector("t", 3, "metres, in camera axes"),
        distortion,
        fisheye=lens == "fisheye",
    )


def check_view_of_room(cameras: Many[Camera], room: Room) -> Iterator[str]:
    """Yield a warning if cameras see nothing of the room, usually since a pose is inverted."""
    steps = np.linspace(0.0, 1.0, 13)
    grid = np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(-1, 3)
    points = room.minimum + grid * (room.maximum - room.minimum)
    blind = [camera.name for camera in cameras if not camera.sees(points).any()]
    if blind:
        yield (
            f"{listed(blind)} {'sees' if len(blind) == 1 else 'see'} nothing of the room: check "
            "that R and t lead from world to camera (x_cam = R x_world + t), that t is in metres, "
            "and [room]"
        )


CAMERA = (
    "name", "image_size", "video", "images", "first_frame", *FIELDS, "background",
    "detections", "detections_first_frame", "detected_steps", "appearance", *POSE, "projection",
)  # fmt: skip
"""The fields of a camera."""


@dataclass(frozen=True, slots=True, eq=False)
class Source:
    """One camera's table and files, before the number of steps is known."""

    name: str
    """The name of the camera."""
    fields: Fields
    """The table of the camera in ``sequence.toml``."""
    video: Path | None
    """The video file; None if there is none."""
    images: tuple[Path, ...]
    """The files of the image list; empty if there is none."""
    pictures_exist: Bool[ndarray, " N"]
    """Whether each frame of the video or image list exists: images may be missing in their
    numbering."""
    pictures: PictureProperties | None
    timing: Timing
    table: BoxTable | None


@dataclass(frozen=True, slots=True)
class Time:
    """The steps of a sequence."""

    fps: float
    """The rate of the steps, 1/s."""
    steps: int
    """The number of steps."""
    beginning: float = 0.0
    """The time stamp of step 0, if cameras have time stamps, seconds."""
    remarks: tuple[str, ...] = ()
    """Sentences on what was estimated since the file does not state it."""
    own_rates: bool = False
    """Whether each video has its own rate, since none is stated and they differ."""


def read_sources(tables: Many[Fields], reading: OpenedFiles) -> tuple[Source, ...]:
    """Read the tables and find the files of all cameras.

    Raises:
        SequenceError: If a file is missing or cannot be read.
    """
    sources: list[Source] = []
    for fields in tables:
        name = fields.text("name")
        if any(character in name for character in ',"#'):
            raise fields.error(
                "name", f"expected no comma, quote or # (it heads CSV columns), found {shown(name)}"
            )
        if name in [source.name for source in sources]:
            raise fields.error("name", "two cameras have this name; rename one of them")
        sources.append(_source(name, fields, reading))
    _check_lengths(sources)
    return tuple(sources)


def _check_lengths(sources: Many[Source]) -> None:
    """Check that the appearance vectors of all cameras have the same length.

    Raises:
        SequenceError: If two lengths differ, since the vectors are then of different networks.
    """
    known = [one for one in sources if one.table is not None and one.table.embeddings.shape[1]]
    for one in known[1:]:
        assert one.table is not None
        assert known[0].table is not None
        own, first = one.table.embeddings.shape[1], known[0].table.embeddings.shape[1]
        if own != first:
            raise one.fields.error(
                "appearance",
                f'expected vectors of {first:,} numbers as in camera "{known[0].name}", found '
                f"{own:,}; use one network for all cameras",
            )


def _source(name: str, fields: Fields, reading: OpenedFiles) -> Source:
    """Read the files that the table of a camera names."""
    if "image_size" in fields:
        _image_size(fields, None)
    if "video" in fields and "images" in fields:
        raise fields.error("images", "expected a video or images, found both; remove one")
    video = locate(reading.folder, fields, "video") if "video" in fields else None
    images: tuple[Path, ...] = ()
    there: Bool[ndarray, " N"] = np.zeros(0, dtype=bool)
    if "images" in fields:
        images, there = find_images(reading.folder, fields)
    stamps = locate(reading.folder, fields, "timestamps") if "timestamps" in fields else None
    timing = read_timing(fields, reading.folder, reading.folder.name, stamps)
    table = read_box_table(fields, reading, timing.first_frame)
    reading.files += [path for path, is_there in zip(images, there, strict=True) if is_there]
    reading.files += [] if video is None else [video]
    if stamps is not None:
        reading.files.append(stamps)
    pictures = probe(video, images, fields)
    if video is not None and pictures is not None:
        there = np.ones(pictures.frames, dtype=bool)
    return Source(name, fields, video, images, there, pictures, timing, table)


def read_views(sources: Many[Source], time: Time, reading: OpenedFiles) -> tuple[View, ...]:
    """Make the views: cameras with their pictures and boxes by step.

    Raises:
        SequenceError: If a table is not valid.
    """
    return tuple(_view(source, time, reading) for source in sources)


def _view(source: Source, time: Time, reading: OpenedFiles) -> View:
    """Return a camera with its boxes and pictures on the steps of the sequence."""
    fields, pictures, timing = source.fields, source.pictures, source.timing
    if time.own_rates and timing.fps is None and pictures is not None and pictures.fps:
        timing = Timing(timing.first_frame, pictures.fps, timing.time_offset, timing.stamps)
    clock = timing.clock(time.fps, time.steps, time.beginning)
    detections, detector_ran = (None, None)
    if source.table is not None:
        detections, detector_ran = source.table.detections(time.steps, clock)
    view = View(
        camera=read_camera(source.name, _image_size(fields, pictures), fields),
        video=source.video,
        images=source.images,
        first_frame=timing.first_frame,
        detections=detections,
        clock=clock,
        detector_ran=detector_ran,
        pictures_exist=source.pictures_exist,
    )
    if pictures is not None:
        reading.warnings += check_pictures(view, pictures, fields, time.steps)
    if "background" not in fields:
        return view
    return replace(view, background=_background(view, fields, time.steps, reading))


def _background(view: View, fields: Fields, steps: int, reading: OpenedFiles) -> Path | range:
    """Read the field ``background``: a picture of the empty scene, or steps without people.

    Raises:
        SequenceError: If the camera has no pictures, or if the field is neither, its picture cannot
            be read or has another size, or its steps do not exist.
    """
    if not view.has_pictures:
        raise fields.error(
            "background", "expected a camera with a video or images, found one without; remove it"
        )
    if fields.is_text("background"):
        path = locate(reading.folder, fields, "background")
        reading.files.append(path)
        picture = read_image(path)
        if picture is None:
            raise fields.error("background", f'"{path.name}" {why_no_picture(path)}')
        check_size(view, fields, (picture.shape[1], picture.shape[0]), "background")
        return path
    if not fields.is_list("background"):
        raise fields.error(
            "background",
            "expected the file of an empty picture in quotes, or the first and the last step "
            f"without anybody such as [0, 24], found {fields.shown('background')}",
        )
    first, last = fields.vector("background", 2, "the first and the last step without anybody")
    if first != int(first) or last != int(last) or not 0 <= first <= last < steps:
        raise fields.error(
            "background",
            f"expected the first and the last step without anybody, whole numbers from 0 to "
            f"{steps - 1}, found {first:g} and {last:g}",
        )
    return range(int(first), int(last) + 1)


def _image_size(fields: Fields, pictures: PictureProperties | None) -> tuple[int, int]:
    """Return the picture's size as stated, or that of the pictures, or about twice the principal
    point."""
    if "image_size" in fields:
        size = fields.vector("image_size", 2, "width and height in pixels", positive=True)
        width, height = fields.checked("image_size", checked_size, size)
        if width * height > MOST_PIXELS:
            raise fields.error(
                "image_size", f"expected at most {MOST_PIXELS:,} pixels, found {width} × {height}"
            )
        return width, height
    if pictures is not None:
        return pictures.size
    return size_around(read_camera("", (1, 1), fields).intrinsics[:2, 2])
