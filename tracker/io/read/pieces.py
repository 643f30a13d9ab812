"""What is read from the files of others, as they wrote it: cameras, boxes, truth, pictures.

A piece holds what one file says and nothing that was guessed. What the file's format does
not define (the unit of a translation, which way a pose leads, whether boxes are given by
corners) is ``None``: it is found out from all pieces together, or told by who imports them.

Pixels have their origin at the centre of the top-left pixel; a reader of a format that puts
it at the pixel's corner takes the half pixel off.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Literal

from jaxtyping import Bool, Float, Int
from numpy import ndarray

Unit = Literal["m", "cm", "mm"]
Direction = Literal["world-to-camera", "camera-to-world"]
Axes = Literal["opencv", "opengl"]
"""Of a camera: x right, y down, z ahead; or x right, y up, z back."""
Up = Literal["x", "y", "z", "-x", "-y", "-z"]
Lens = Literal["pinhole", "rational", "fisheye"]
Layout = Literal["ltwh", "xyxy", "cxcywh"]
"""Of a box's four numbers: left, top, width, height; left, top, right, bottom; centre and size."""

INVERSE = "-inverse"
"""Behind the name of a product of turns: it leads into the camera."""

IN_DEGREES = " in degrees"
"""Behind the name of a product of turns."""

METRES: dict[Unit, float] = {"m": 1.0, "cm": 0.01, "mm": 0.001}
"""Metres in one of each unit."""


class FormatError(ValueError):
    """A file cannot be read; the message names it and the field, expected, found, what to do."""


@dataclass(frozen=True, slots=True)
class Convention:
    """How a format means its poses; None where it leaves it open."""

    unit: Unit | None = None
    direction: Direction | None = None
    axes: Axes | None = None
    up: Up | None = None
    """The world axis that points up."""


@dataclass(frozen=True, slots=True, eq=False)
class RawCamera:
    """One camera as its file gives it; None where the file does not say.

    A file may hold the lens alone or the pose alone: pieces of the same camera are put together
    by who collects them. ``projection`` stands in place of lens and pose.
    """

    name: str
    image_size: tuple[int, int] | None = None
    """Width and height, pixels."""
    intrinsics: Float[ndarray, "3 3"] | None = None
    """K, pixels."""
    distortion: Float[ndarray, " n"] | None = None
    """OpenCV's order: k1 k2 p1 p2 [k3 [k4 k5 k6 …]], or k1 k2 k3 k4 of a fisheye."""
    lens: Lens = "pinhole"
    rotation: Float[ndarray, "3 3"] | None = None
    translation: Float[ndarray, " 3"] | None = None
    """As the file has it: t of ``x_camera = R x_world + t``, or the camera's place where the
    direction is camera-to-world. In the convention's unit."""
    convention: Convention = Convention()
    turns: Mapping[str, Float[ndarray, "3 3"]] = field(default_factory=lambda: MappingProxyType({}))
    """Of a rotation given by angles all that it may be, by how these are composed; ``rotation`` is
    the first of them."""
    projection: Float[ndarray, "3 4"] | None = None
    """World (in the convention's unit) to pixels, up to scale."""


@dataclass(frozen=True, slots=True, eq=False)
class CalibrationPiece:
    """The cameras of one file."""

    source: Path
    format: str
    cameras: tuple[RawCamera, ...]


@dataclass(frozen=True, slots=True, eq=False)
class DetectionPiece:
    """Boxes of one camera. D rows, in the file's order."""

    source: Path
    format: str
    camera: str
    """What the file or its name says of the camera; may be empty or a number."""
    frames: Int[ndarray, " D"]
    """As the file counts them."""
    boxes: Float[ndarray, "D 4"]
    """As the file has them, in ``layout``; left, top, width, height where it is None."""
    scores: Float[ndarray, " D"]
    """0 … 1; 1 where the file has none."""
    layout: Layout | None = None
    """None where the columns do not tell: four numbers that may be sizes or corners."""
    normalised: bool | None = False
    """Whether boxes are parts of the picture's size, not pixels."""
    first_index: Literal[0, 1] | None = None
    """The number of the first frame; None where the format leaves it open."""
    last_frame: int | None = None
    """The last frame that was looked at, where the file says so although nobody was seen in it."""
    fps: float | None = None
    """Frames a second, where the file has times."""
    keypoints: Float[ndarray, "D J 3"] | None = None
    """x, y in pixels and confidence of J joints, NaN where not seen."""
    classes: tuple[str, ...] | None = None
    """What each row is said to be."""
    image_size: tuple[int, int] | None = None
    """Width and height, where the file gives them."""


@dataclass(frozen=True, slots=True, eq=False)
class TruthPiece:
    """Where people were. G rows."""

    source: Path
    format: str
    frames: Int[ndarray, " G"]
    ids: Int[ndarray, " G"]
    positions: Float[ndarray, "G 3"]
    """In ``unit``; the third coordinate is NaN where the file gives a place on the floor."""
    unit: Unit | None = None
    up: Up | None = None
    fps: float | None = None
    first_index: Literal[0, 1] | None = None
    valid: Bool[ndarray, " G"] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class VideoPiece:
    """One video file."""

    path: Path
    frames: int
    fps: float
    size: tuple[int, int]
    """Width and height of a picture as it is decoded, pixels."""
    rotated: bool = False
    """Whether the file tells players to turn its pictures (``size`` is after the turn)."""


@dataclass(frozen=True, slots=True, eq=False)
class ImagesPiece:
    """A folder of numbered pictures."""

    folder: Path
    files: tuple[Path, ...]
    """In the order of their numbers."""
    size: tuple[int, int]
    """Width and height of the first, pixels."""


@dataclass(frozen=True, slots=True, eq=False)
class TimesPiece:
    """When one camera took its frames. F frames."""

    source: Path
    camera: str
    """What the file says of the camera: the number of its port; may be empty."""
    times: Float[ndarray, " F"]
    """Seconds, ascending, from a beginning that all cameras share."""


Piece = CalibrationPiece | DetectionPiece | TruthPiece | VideoPiece | ImagesPiece | TimesPiece
