"""All formats that are read: those of this project, and those of plugins."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from importlib.metadata import entry_points

from tracker.io.read.calibration import (
    camera_rows,
    matlab,
    named_format,
    projection,
    trees,
)
from tracker.io.read.calibration.datasets import matrices, tsai
from tracker.io.read.calibration.reconstruction import colmap, scenes
from tracker.io.read.detections import (
    arrays,
    coco,
    motchallenge,
    nested,
    numbers,
    nvidia,
    openpose,
    parquet,
    scenescape,
    table,
    tables,
    yolo,
)
from tracker.io.read.detections.annotations import cvat, label_studio, labelme, via, voc
from tracker.io.read.pictures import images, times, video
from tracker.io.read.pieces import FormatError
from tracker.io.read.protocol import Certainty, Format
from tracker.io.read.refused import refusal
from tracker.io.read.source import SourceFile
from tracker.io.read.truth import panoptic, trc, wildtrack

GROUP = "multiview_phd.formats"
"""The group of entry points of plugins; each names a module or object that is a
:class:`Format`."""

FORMATS: tuple[Format, ...] = (
    *trees.FORMATS,
    named_format.OPENCV,
    *colmap.FORMATS,
    *scenes.FORMATS,
    tsai.TSAI,
    *matrices.FORMATS,
    projection,
    matlab,
    named_format.LABELLED,
    named_format.PLAIN,
    camera_rows,
    numbers,
    motchallenge,
    *tables.FORMATS,
    coco,
    yolo,
    openpose,
    cvat,
    labelme,
    label_studio,
    via,
    voc,
    nvidia,
    scenescape,
    nested,
    table,
    parquet,
    arrays,
    wildtrack,
    trc,
    panoptic,
    video,
    images,
    times,
)


@cache
def all_formats() -> tuple[Format, ...]:
    """Return this project's formats, and those of plugins.

    Raises:
        FormatError: If a plugin's entry point is not a format.
    """
    found: list[Format] = list(FORMATS)
    for point in entry_points(group=GROUP):
        try:
            added: Format = point.load()
            _ = (added.NAME, added.KIND, added.SERIES, added.recognise, added.read)
        except Exception as error:
            raise FormatError(
                f"{GROUP}: {point.name} ({point.value}) cannot be used as a format ({error}); "
                "expected NAME, KIND, SERIES, recognise and read of tracker.io.read.protocol, or "
                "a TreeFormat or TableFormat of tracker.io.read"
            ) from None
        found.append(added)
    return tuple(found)


def unforeseen(file: SourceFile, format_: Format, error: Exception) -> FormatError:
    """Return the error for an unexpected exception of a format's reader.

    Args:
        file: The file that was read.
        format_: The format whose reader raised the exception.
        error: The exception.
    """
    words = " ".join(str(error).split()) or type(error).__name__
    return file.error(
        f"expected what {format_.NAME} has, found a value that cannot be read ({words[:200]}); "
        "it may be spoilt: get the file again"
    )


def recognise(
    file: SourceFile, formats: Sequence[Format] | None = None
) -> tuple[Format | None, Certainty, FormatError | None]:
    """Find the format of a file by the certainties of all formats.

    Args:
        file: The file.
        formats: The formats to try; all if None.

    Returns:
        The format with the highest certainty, the last one of equals, or None; its certainty; and
        if there is none, the error of a format that recognised the beginning of the file, or the
        reason why files of its kind are not read.
    """
    best: tuple[Format | None, Certainty] = (None, Certainty.NO)
    complaint: FormatError | None = None
    for one in all_formats() if formats is None else formats:
        try:
            certainty = one.recognise(file)
        except FormatError as error:
            complaint = complaint or error
            continue
        except Exception as error:
            # an unexpected exception of a reader means that the file is not of its format
            complaint = complaint or unforeseen(file, one, error)
            continue
        if certainty > Certainty.NO and certainty >= best[1]:
            best = (one, certainty)
    if best[0] is not None:
        return *best, None
    return *best, refusal(file, complaint)
