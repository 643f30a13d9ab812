"""Arguments of ``import``, ``check``, ``formats`` and ``export-calibration``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import FlagCreatePairsOff, Positional, UseAppendAction, arg


@dataclass
class Import:
    """Make a sequence folder of recordings, calibrations and boxes in other programs' formats."""

    sources: Annotated[
        Positional[tuple[Path, ...]],
        arg(
            metavar="SOURCE …",
            help="Files, or a folder with all in it; `formats` lists kinds.",
            help_behavior_hint="",
        ),
    ]
    output: Annotated[
        Path | None,
        arg(aliases=["-o"], metavar="FOLDER", help_behavior_hint="(required without --dry-run)"),
    ] = None
    """The folder to write."""
    dry_run: FlagCreatePairsOff[bool] = False
    """Only print what each file is taken for and what was found out."""
    copy: FlagCreatePairsOff[bool] = False
    """Copy videos and pictures, which are otherwise linked."""
    name: str = ""
    """Of the sequence; the folder's name if it is not given."""
    unit: Annotated[
        str | None, arg(metavar="m|cm|mm|METRES", help_behavior_hint="(default: found out)")
    ] = None
    """Unit of the calibration, or how many metres one of its units has."""
    up: Annotated[
        Literal["x", "y", "z", "-x", "-y", "-z"] | None,
        arg(help_behavior_hint="(default: found out)"),
    ] = None
    """Axis of the calibration's world that points up."""
    pose: Annotated[
        Literal["world-to-camera", "camera-to-world"] | None,
        arg(help_behavior_hint="(default: found out)"),
    ] = None
    """Where R and t lead."""
    axes: Annotated[
        Literal["opencv", "opengl"] | None, arg(help_behavior_hint="(default: found out)")
    ] = None
    """Axes of a camera: y down and z ahead, or y up and z back."""
    euler: Annotated[str | None, arg(help_behavior_hint="(default: found out)")] = None
    """How rotations given by three angles are composed: zyx is R = Rz Ry Rx, zyx-inverse its
    inverse; vector: they are a rotation vector."""
    boxes: Annotated[
        Literal[
            "ltwh",
            "xyxy",
            "yxyx",
            "cxcywh",
            "ltwh-normalised",
            "xyxy-normalised",
            "yxyx-normalised",
            "cxcywh-normalised",
        ]
        | None,
        arg(help_behavior_hint="(default: found out)"),
    ] = None
    """What the four numbers of a box are: left, top and size; two corners, x or y first; centre and
    size; in pixels, or normalised: as parts of the picture's width and height."""
    first_index: Annotated[int | None, arg(help_behavior_hint="(default: found out)")] = None
    """Number of the first frame in boxes and truth, 0 or 1."""
    fps: Annotated[float | None, arg(help_behavior_hint="(default: the videos')")] = None
    """Steps a second."""
    accept_best: FlagCreatePairsOff[bool] = False
    """Take the likeliest interpretation where the files leave open how they are meant (status 3),
    or where none explains the boxes (status 4)."""
    as_named: FlagCreatePairsOff[bool] = False
    """Leave calibrations with the cameras of their names, though boxes may meet better with some
    of them exchanged."""
    camera: Annotated[
        UseAppendAction[tuple[str, ...]],
        arg(metavar="NAME=FILE", help_behavior_hint="(repeatable)"),
    ] = ()
    """Video, folder of pictures or boxes of a camera, where names do not tell."""
    swap: Annotated[
        UseAppendAction[tuple[str, ...]],
        arg(metavar="NAME=NAME", help_behavior_hint="(repeatable)"),
    ] = ()
    """Two cameras whose calibrations are each other's; exchanged in the order given."""


@dataclass
class Check:
    """Check a sequence: calibration, boxes, room, sizes and time, each with what mends it."""

    sequence: Annotated[
        Positional[str], arg(metavar="SEQUENCE", help="A built-in room's name or a folder.")
    ]


@dataclass
class Formats:
    """List the formats that `import` reads and `export-calibration` writes."""


@dataclass
class ExportCalibration:
    """Write a sequence's cameras in the form of another program."""

    sequence: Annotated[
        Positional[str], arg(metavar="SEQUENCE", help="A built-in room's name or a folder.")
    ]
    output: Annotated[Path, arg(aliases=["-o"], metavar="FILE")]
    """The file to write; it must not exist yet."""
    form: Literal["opencv", "pose2sim"] = "opencv"
    """OpenCV's FileStorage (YAML, or XML by the file's suffix) or Pose2Sim's TOML."""
