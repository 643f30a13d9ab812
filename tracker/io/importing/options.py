"""What whoever imports knows better than the files: each overrules one guess.

Defined once: the engine takes :class:`ImportOptions`, the page's wish and the flags of the command
line are checked by it.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from tracker.io.read.pieces import Axes, Direction, Layout, Unit, Up

Corner = tuple[float, float, float]
"""x, y, z in metres."""

MOST = 200
"""Cameras of which something may be stated."""


class CommonImportOptions(BaseModel):
    """What can be stated of any import; None and empty: to be found out."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", allow_inf_nan=False, use_attribute_docstrings=True
    )

    unit: Unit | Annotated[float, Field(gt=0.0, lt=1e6)] | None = None
    """Of the calibration; a number is metres in one of its units."""
    up: Up | None = None
    """The world's axis that points up."""
    pose: Direction | None = None
    """Where R and t lead."""
    axes: Axes | None = None
    """Of a camera."""
    turns: Annotated[str, Field(max_length=40)] | None = None
    """How rotations given by three angles are composed: ``zyx`` is R_z R_y R_x."""
    boxes: Layout | None = None
    """What the four numbers of a box mean."""
    normalised: bool | None = None
    """Whether boxes are parts of the picture's size."""
    first_index: Literal[0, 1] | None = None
    """The number of the first frame in detections and truth."""
    fps: Annotated[float, Field(gt=0.0, le=1000.0)] | None = None
    """Steps a second."""
    accept_best: bool = False
    """Whether the likeliest interpretation is taken where the files leave open how they are meant,
    or where none explains the boxes."""
    swap: tuple[tuple[str, str], ...] = Field(default=(), max_length=MOST)
    """Two cameras each whose calibrations are exchanged, one exchange after the other."""
    as_named: bool = False
    """Whether calibrations stay with the cameras of their names, though boxes may meet better with
    some of them exchanged."""
    left_out: tuple[str, ...] = Field(default=(), max_length=MOST)
    """Cameras of the calibration that are not wanted."""
    names: Mapping[str, str] = Field(default={}, max_length=MOST)
    """What cameras are to be called, by their name in the calibration."""
    offsets: Mapping[str, float] = Field(default={}, max_length=MOST)
    """Seconds that are added to the time of every frame, by camera."""
    room: tuple[Corner, Corner] | None = None
    """The room's lowest and highest corner."""
    half_extents: Corner | None = None
    """Half width, depth and height of what is tracked, metres."""
    entrances: tuple[tuple[Corner, Corner], ...] = Field(default=(), max_length=50)
    """Of each the position and the standard deviations, metres."""


class ImportOptions(CommonImportOptions):
    """What is stated of an import, with files of cameras by their path."""

    cameras: tuple[tuple[str, Path], ...] = ()
    """Video, pictures or boxes that belong to a camera of the calibration: its name, and what."""
