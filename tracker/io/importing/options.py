"""What whoever imports knows better than the files: each overrules one guess."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Literal

from tracker.io.read.pieces import Axes, Direction, Layout, Unit, Up

Corner = tuple[float, float, float]
"""x, y, z in metres."""


@dataclass(frozen=True, slots=True)
class ImportOptions:
    """None: to be found out."""

    unit: Unit | float | None = None
    """Of the calibration; a number is metres in one of its units."""
    up: Up | None = None
    """The world's axis that points up."""
    pose: Direction | None = None
    """Where R and t lead."""
    axes: Axes | None = None
    """Of a camera."""
    turns: str | None = None
    """How rotations given by three angles are composed: ``zyx`` is R_z R_y R_x."""
    boxes: Layout | None = None
    """What the four numbers of a box mean."""
    normalised: bool | None = None
    """Whether boxes are parts of the picture's size."""
    first_index: Literal[0, 1] | None = None
    """The number of the first frame in detections and truth."""
    fps: float | None = None
    """Steps a second."""
    accept_best: bool = False
    """Whether the likeliest interpretation is taken where the files leave open how they are meant,
    or where none explains the boxes."""
    cameras: tuple[tuple[str, Path], ...] = ()
    """Video, pictures or boxes that belong to a camera of the calibration: its name, and what."""
    swap: tuple[tuple[str, str], ...] = ()
    """Two cameras each whose calibrations are exchanged, one exchange after the other."""
    left_out: frozenset[str] = frozenset()
    """Cameras of the calibration that are not wanted."""
    names: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    """What cameras are to be called, by their name in the calibration."""
    offsets: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    """Seconds that are added to the time of every frame of a camera."""
    room: tuple[Corner, Corner] | None = None
    """The room's lowest and highest corner."""
    half_extents: Corner | None = None
    """Half width, depth and height of what is tracked, metres."""
    entrances: tuple[tuple[Corner, Corner], ...] = ()
    """Of each the position and the standard deviations, metres."""
