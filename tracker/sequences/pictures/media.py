"""The files that a sequence names: they are found in its folder, and pictures are validated."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool
from numpy import ndarray

from tracker.files.folders import files_matching
from tracker.sequences.errors import SequenceError
from tracker.sequences.fields import LONGEST_NAME, Fields, did_you_mean, listed
from tracker.sequences.pictures.numbering import by_number, whole_row
from tracker.sequences.pictures.video import VideoError, index_video, read_image, why_no_picture
from tracker.sequences.sequence import View


def locate(folder: Path, fields: Fields, name: str) -> Path:
    """Return the path of the file that a field names.

    Args:
        folder: The folder of the sequence.
        fields: The table with the field.
        name: The field.

    Raises:
        SequenceError: If the file does not exist, is no ordinary file, or is outside the folder.
    """
    given = fields.text(name)
    path = _inside(folder, given, fields, name)
    if not path.exists():
        siblings = [p.name for p in path.parent.iterdir()] if path.parent.is_dir() else []
        hint = did_you_mean(path.name, siblings)
        raise fields.error(name, f'there is no file "{given}" in the sequence folder{hint}')
    if not path.is_file():
        what = "folder" if path.is_dir() else "pipe or device"
        raise fields.error(name, f'expected a file, found the {what} "{given}"')
    return path


def find_images(folder: Path, fields: Fields) -> tuple[tuple[Path, ...], Bool[ndarray, " N"]]:
    """Return the pictures that match the pattern ``images``, sorted by name.

    Args:
        folder: The folder of the sequence.
        fields: The camera's table, with the field ``images``.

    Returns:
        The pictures, with those that are missing in their numbering, and whether each exists.

    Raises:
        SequenceError: If no picture matches, or one is outside the folder.
    """
    pattern = fields.text("images")
    _inside(folder, pattern, fields, "images")
    try:
        images = files_matching(folder, pattern)
    except ValueError as error:
        raise fields.error("images", f'"{pattern}" is not a file pattern ({error})') from None
    if not images:
        raise fields.error(
            "images", f'no file matches "{pattern}"; put the pictures there or correct the pattern'
        )
    for path in images:
        _inside(folder, path.relative_to(folder).as_posix(), fields, "images")
    return whole_row(images)


def _inside(folder: Path, given: str, fields: Fields, name: str) -> Path:
    """Return a path in the folder, and check that neither it nor a symbolic link leaves it."""
    path = folder / given
    longest = max((len(os.fsencode(part)) for part in path.parts), default=0)
    if longest > LONGEST_NAME:
        raise fields.error(
            name,
            f"expected names of at most {LONGEST_NAME} bytes, found one of {longest}; shorten it",
        )
    outright = Path(given).is_absolute() or ".." in Path(given).parts
    try:
        leaves = outright or not path.resolve().is_relative_to(folder.resolve())
    except (OSError, RuntimeError, ValueError):  # a loop of links, or an impossible name
        raise fields.error(
            name,
            f'expected a path to a file, found "{given}", which leads nowhere; put the file there',
        ) from None
    if leaves:
        how = "" if outright else " (by a symbolic link)"
        raise fields.error(
            name,
            f'expected a path inside the sequence folder, found "{given}", which leaves it{how}; '
            "copy the file into the folder",
        )
    return path


@dataclass(frozen=True, slots=True, eq=False)
class PictureProperties:
    """The properties of one camera's pictures, found by opening them once."""

    size: tuple[int, int]
    """Width and height, pixels."""
    frames: int
    """The number of frames."""
    fps: float | None
    """The frame rate, 1/s; None for images, and for a video that does not state it."""


def probe(video: Path | None, images: tuple[Path, ...], fields: Fields) -> PictureProperties | None:
    """Determine the properties of a camera's video or images; None if there is neither.

    Args:
        video: The video, or None.
        images: The image files in their order; there may be none.
        fields: The camera's table, for messages.

    Raises:
        SequenceError: If the video or the first image cannot be read.
    """
    if video is not None:
        try:
            index = index_video(video)
        except (VideoError, OSError) as error:
            size = video.stat().st_size
            raise fields.error(
                "video",
                f'"{video.name}" ({size:,} bytes) cannot be read as a video ({error}); '
                "expected MP4, AVI or another format that FFmpeg decodes",
            ) from None
        return PictureProperties(index.size, index.frames, index.fps)
    if images:
        picture = read_image(images[0])
        if picture is None:
            raise fields.error("images", f'"{images[0].name}" {why_no_picture(images[0])}')
        return PictureProperties((picture.shape[1], picture.shape[0]), len(images), None)
    return None


def check_pictures(
    view: View, found: PictureProperties, fields: Fields, frames: int
) -> Iterable[str]:
    """Check the size and the number of a camera's pictures.

    Args:
        view: The camera, with the files of its pictures.
        found: The properties of the pictures.
        fields: The camera's table, for messages.
        frames: The number of steps of the sequence.

    Returns:
        Warnings on missing pictures, and on images whose names do not sort by number.

    Raises:
        SequenceError: If the size is not that of the calibration.
    """
    if view.video is not None:
        check_size(view, fields, found.size, "frame size")
        return list(_short(view, found.frames, frames, "video has"))
    check_size(view, fields, found.size, "image size")
    warnings = [*_holes(view), *_short(view, found.frames, frames, "images are")]
    ordered = sorted(view.images, key=lambda path: by_number(path.as_posix()))
    for first, other in zip(ordered, view.images, strict=True):
        if first != other:
            warnings.append(
                f'camera "{view.camera.name}": images are taken in the order of their names, '
                f'so "{other.name}" comes before "{first.name}"; write the numbers with '
                "leading zeros"
            )
            break
    return warnings


def check_size(view: View, fields: Fields, found: tuple[int, int], what: str) -> None:
    """Check that pictures have the size of their camera's calibration.

    Args:
        view: The camera.
        fields: The camera's table, for the message.
        found: Width and height of the pictures, pixels.
        what: What has this size, for the message.

    Raises:
        SequenceError: If the sizes differ.
    """
    expected = view.camera.image_size
    if found != expected:
        raise SequenceError(
            f"{fields.where}: {what} {found[0]}×{found[1]} does not match calibration "
            f"{expected[0]}×{expected[1]}; scale the calibration or the pictures"
        )


def _short(view: View, there: int, frames: int, what: str) -> Iterable[str]:
    """Yield a sentence if a video or image list has fewer frames than the steps need."""
    if view.clock is not None:
        last = np.flatnonzero(view.clock.frame_of_step >= there)
        if len(last):
            yield (
                f'camera "{view.camera.name}": the {what} too few: expected at least '
                f"{int(view.clock.frame_of_step.max()) + 1} frames, found {there}; from step "
                f"{int(last[0])} on it has no picture"
            )
        return
    steps = max(0, there - view.first_frame)
    if steps < frames:
        offset = f" from frame {view.first_frame} on" if view.first_frame else ""
        missing = (
            f"steps {steps} to {frames - 1} have" if frames - steps > 1 else f"step {steps} has"
        )
        yield (
            f'camera "{view.camera.name}": the {what} too few: expected {frames} '
            f"frames{offset}, found {steps}; {missing} no picture"
        )


def _holes(view: View) -> Iterable[str]:
    """Yield a warning if pictures are missing in the numbering."""
    if view.pictures_exist is None or view.pictures_exist.all():
        return
    names = [view.images[k].name for k in np.flatnonzero(~view.pictures_exist)]
    shown = listed(f'"{name}"' for name in names[:3]) if len(names) < 4 else f'"{names[0]}"'
    others = "" if len(names) < 4 else f" and {len(names) - 1} others"
    yield (
        f'camera "{view.camera.name}": {shown}{others} '
        f"{'is' if len(names) == 1 else 'are'} missing in the row of its pictures; the steps there "
        "have no picture (where none is missing, number the files one by one)"
    )
