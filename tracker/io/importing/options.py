"""What whoever imports knows better than the files: each overrules one guess.

Defined once: the engine takes :class:`ImportOptions`; the page's wish and the flags of the command
line, with their help, are made from it.
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
    """Unit of the calibration, or how many metres one of its units has."""
    up: Up | None = None
    """Axis of the calibration's world that points up."""
    pose: Direction | None = None
    """What R and t map: points of the world to the camera, points of the camera to the world,
    the first with R transposed, as of points in rows, or with the camera's position as t."""
    axes: Axes | None = None
    """Axes of a camera: y down and z ahead, or y up and z back."""
    turns: Annotated[str, Field(max_length=40)] | None = None
    """How rotations given by three angles are composed: zyx is R = Rz Ry Rx, zyx-inverse its
    inverse; vector: they are a rotation vector."""
    boxes: Layout | None = None
    """What the four numbers of a box are: left, top and size; two corners, x or y first; centre and
    size; in pixels, or normalised: as parts of the picture's width and height."""
    normalised: bool | None = None
    """Whether boxes are parts of the picture's size."""
    first_index: Literal[0, 1] | None = None
    """Number of the first frame in boxes and truth."""
    fps: Annotated[float, Field(gt=0.0, le=1000.0)] | None = None
    """Steps a second; those of the videos, unless stated."""
    accept_best: bool = False
    """Take the likeliest interpretation where the files leave open how they are meant, or where
    none explains the boxes."""
    swap: tuple[tuple[str, str], ...] = Field(default=(), max_length=MOST)
    """Two cameras whose calibrations are each other's; exchanged in the order given."""
    as_named: bool = False
    """Leave calibrations with the cameras of their names, though boxes may meet better with some of
    them exchanged."""
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
    """Video, folder of pictures or boxes of a camera, where names do not tell."""
