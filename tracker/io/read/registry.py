"""Every format that is read: one line each, and what is installed beside the program."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from importlib.metadata import entry_points

from tracker.io.read.calibration import (
    camera_rows,
    camera_tables,
    kalibr,
    labelled,
    matlab,
    opencv,
    plain,
    projection,
    ros,
)
from tracker.io.read.calibration.capture import qualisys
from tracker.io.read.calibration.datasets import middlebury, panoptic, tsai, voxelpose
from tracker.io.read.calibration.reconstruction import (
    colmap,
    colmap_binary,
    metashape,
    mvsnet,
    nerfstudio,
    openmvg,
)
from tracker.io.read.detections import coco, motchallenge, nested, parquet, table, yolo
from tracker.io.read.detections.annotations import cvat, label_studio, labelme, via, voc
from tracker.io.read.detections.poses import openpose
from tracker.io.read.pictures import images, times, video
from tracker.io.read.pieces import FormatError
from tracker.io.read.protocol import Certainty, Format
from tracker.io.read.refused import refusal
from tracker.io.read.source import SourceFile
from tracker.io.read.truth import panoptic as panoptic_skeletons
from tracker.io.read.truth import trc, wildtrack

GROUP = "multiview_phd.formats"
"""Entry points: each names a module or object that is a :class:`Format`."""

FORMATS: tuple[Format, ...] = (
    opencv,
    camera_tables,
    qualisys,
    colmap,
    colmap_binary,
    nerfstudio,
    metashape,
    mvsnet,
    openmvg,
    kalibr,
    ros,
    panoptic,
    tsai,
    voxelpose,
    middlebury,
    projection,
    matlab,
    labelled,
    plain,
    camera_rows,
    motchallenge,
    coco,
    yolo,
    openpose,
    cvat,
    labelme,
    label_studio,
    via,
    voc,
    nested,
    table,
    parquet,
    wildtrack,
    trc,
    panoptic_skeletons,
    video,
    images,
    times,
)


@cache
def all_formats() -> tuple[Format, ...]:
    """The program's own formats, and those of installed packages.

    Raises:
        FormatError: If an installed one is no format.
    """
    found: list[Format] = list(FORMATS)
    for point in entry_points(group=GROUP):
        try:
            added: Format = point.load()
            _ = (added.NAME, added.KIND, added.SERIES, added.recognise, added.read)
        except Exception as error:
            raise FormatError(
                f"{GROUP}: {point.name} ({point.value}) cannot be used as a format: {error}"
            ) from None
        found.append(added)
    return tuple(found)


def unforeseen(file: SourceFile, format_: Format, error: Exception) -> FormatError:
    """What is said of a file over which a format's reader stumbled."""
    words = " ".join(str(error).split()) or type(error).__name__
    return file.error(
        f"expected what {format_.NAME} has, found a value that cannot be read ({words[:200]}); "
        "it may be spoilt: get the file again"
    )


def recognise(
    file: SourceFile, formats: Sequence[Format] | None = None
) -> tuple[Format | None, Certainty, FormatError | None]:
    """The surest format of a file; of two that are as sure, the one registered last.

    Returns:
        The format, None where there is none; its certainty; and, where there is none, what
        one of them said that saw the file begin as its own.
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
            # whatever a reader, of this program or another package, does not foresee in a file
            # says no more than that the file is not one of its own
            complaint = complaint or unforeseen(file, one, error)
            continue
        if certainty > Certainty.NO and certainty >= best[1]:
            best = (one, certainty)
    if best[0] is not None:
        return *best, None
    return *best, refusal(file, complaint)
