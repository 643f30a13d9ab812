"""What whoever imports knows better than the files: each overrules one guess."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from tracker.formats.pieces import Axes, Direction, Layout, Unit, Up


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
    boxes: Layout | None = None
    """What the four numbers of a box mean."""
    first_index: Literal[0, 1] | None = None
    """The number of the first frame in detections and truth."""
    fps: float | None = None
    """Steps a second."""
    cameras: dict[str, Path] = field(default_factory=dict)
    """Video, pictures or boxes that belong to a camera of the calibration, by its name."""
