"""Arguments of ``import``, ``check``, ``formats`` and ``export-calibration``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import FlagCreatePairsOff, Positional, arg

IMPORT_FLAGS = {
    "unit": "unit",
    "up": "up",
    "pose": "pose",
    "axes": "axes",
    "turns": "euler",
    "boxes": "boxes",
    "first_index": "first_index",
    "fps": "fps",
    "accept_best": "accept_best",
    "as_named": "as_named",
    "cameras": "camera",
    "swap": "swap",
}
"""The flag of each of the engine's ``ImportOptions`` that a word can state."""

PAIRS = {"cameras": "NAME=FILE", "swap": "NAME=NAME"}
"""The form of the options that are given once per pair."""


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
