"""The parsed content of files of other programs: cameras, boxes, truth, pictures.

A piece has the content of one file without any guess. What the file's format does not define (the
unit of a translation, the direction of a pose, whether boxes are given by corners) is ``None``: it
is estimated from all pieces together, or stated by the user.

The origin of pixels is the centre of the top-left pixel; readers of formats with the origin at the
pixel's corner subtract half a pixel.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.geometry.calibration import Lens

Unit = Literal["m", "cm", "mm"]
Direction = Literal["world-to-camera", "camera-to-world", "transposed", "position"]
"""What R and t map: x_camera = R x_world + t; x_world = R x_camera + t; the first with R
transposed, as of points in rows, x_cameraᵀ = x_worldᵀ R + tᵀ, and of files column by column; or the
first with the camera's position as t, x_camera = R (x_world - t), as Human3.6M has it."""
Axes = Literal["opencv", "opengl"]
"""The axes of a camera: x right, y down, z ahead (OpenCV); or x right, y up, z back (OpenGL)."""
Up = Literal["x", "y", "z", "-x", "-y", "-z"]
Layout = Literal["ltwh", "xyxy", "yxyx", "cxcywh"]
"""The meaning of a box's four numbers: left, top, width, height; left, top, right, bottom; or
centre and size."""

INVERSE = "-inverse"
"""The suffix of the name of an order of Euler angles whose rotation is inverted, so that it maps
into the camera."""

IN_DEGREES = " in degrees"
"""The suffix of the name of an order of Euler angles in degrees."""

METRES: dict[Unit, float] = {"m": 1.0, "cm": 0.01, "mm": 0.001}
"""Metres in one of each unit."""


_UNIT_WORDS: dict[Unit, tuple[str, ...]] = {
    "m": ("m", "meter", "metre"),
    "cm": ("cm", "centimeter", "centimetre"),
    "mm": ("mm", "millimeter", "millimetre"),
}


def unit_named(word: str) -> Unit | None:
    """Return the unit that a file names, short or in full; None for any other word."""
    name = word.strip().lower().removesuffix("s")
    return next((unit for unit, words in _UNIT_WORDS.items() if name in words), None)


class FormatError(ValueError):
    """A file cannot be read; the message names the file and the field, and says what to do."""


@dataclass(frozen=True, slots=True)
class Convention:
    """The convention of a format's poses; None for what the format does not define."""

    unit: Unit | None = None
    direction: Direction | None = None
    axes: Axes | None = None
    up: Up | None = None
    """The world axis that points up."""


@dataclass(frozen=True, slots=True, eq=False)
class RawCamera:
    """One camera as its file describes it; None for what the file does not state.

    A file may have the lens alone or the pose alone; pieces of the same camera are combined later.
    ``projection`` replaces lens and pose.
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
    """The translation as in the file, in the convention's unit: t of ``x_camera = R x_world + t``,
    or the camera's position if the direction is camera-to-world or position."""
    convention: Convention = Convention()
    turns: Mapping[str, Float[ndarray, "3 3"]] = field(default_factory=lambda: MappingProxyType({}))
    """For a rotation given by angles, or a quaternion of unknown order, all possible rotations by
    the name of the order; ``rotation`` is the first of them."""
    projection: Float[ndarray, "3 4"] | None = None
    """The projection from world coordinates (in the convention's unit) to pixels, up to scale."""

    @property
    def has_pose(self) -> bool:
        """Whether the file states the camera's pose."""
        return self.projection is not None or self.rotation is not None

    @property
    def has_lens(self) -> bool:
        """Whether the file states the camera's lens."""
        return self.projection is not None or self.intrinsics is not None

    def with_lens_of(self, other: RawCamera) -> RawCamera:
        """Return the camera with the lens of another entry, and its size of pictures."""
        return replace(
            self,
            image_size=other.image_size,
            intrinsics=other.intrinsics,
            distortion=other.distortion,
            lens=other.lens,
        )


@dataclass(frozen=True, slots=True, eq=False)
class CalibrationPiece:
    """The cameras of one file."""

    source: Path
    format: str
    cameras: tuple[RawCamera, ...]


@dataclass(frozen=True, slots=True, eq=False)
class DetectionPiece:
    """The D boxes of one camera, in the file's order."""

    source: Path
    format: str
    camera: str
    """The camera's name in the file or in the file's name; it may be empty or a number."""
    frames: Int[ndarray, " D"]
    """The frame of each box, in the file's counting."""
    boxes: Float[ndarray, "D 4"]
    """The boxes as in the file, in ``layout``; left, top, width, height if that is None."""
    scores: Float[ndarray, " D"]
    """The score of each box, 0 … 1; 1 if the file has none."""
    layout: Layout | None = None
    """The meaning of the four numbers; None if the file does not tell sizes from corners."""
    normalised: bool | None = False
    """Whether boxes are fractions of the picture's size rather than pixels."""
    first_index: Literal[0, 1] | None = None
    """The number of the first frame; None if the format does not define it."""
    last_frame: int | None = None
    """The last frame that the detector processed, if the file states it though it has no box."""
    fps: float | None = None
    """The frame rate, if the file has times, 1/s."""
    begins: float | None = None
    """The time of frame 0 since the beginning of 1970, if the file has dates, seconds."""
    keypoints: Float[ndarray, "D J 3"] | None = None
    """x, y in pixels and confidence of J joints; NaN for a joint that is not seen."""
    image_size: tuple[int, int] | None = None
    """Width and height of the pictures, if the file states them, pixels."""
    left_out: str = ""
    """A sentence about rows of the file that are no boxes of people; empty where there are none."""


@dataclass(frozen=True, slots=True)
class Grid:
    """A grid of numbered places on the floor, row by row."""

    name: str
    """The data set that defines the grid, or how it was inferred."""
    columns: int
    cell: float
    """Metres."""
    origin: tuple[float, float] = (0.0, 0.0)
    """x and y of cell 0, metres."""

    def places(self, cells: Int[ndarray, " G"]) -> Float[ndarray, "G 2"]:
        """Return x and y of the cells in metres."""
        steps = np.column_stack([cells % self.columns, cells // self.columns])
        return np.asarray(self.cell * steps + self.origin)


GRIDS = (
    Grid("WILDTRACK", 480, 0.025, (-3.0, -9.0)),
    Grid("MultiviewX", 1000, 0.025),
)
"""Grids that data sets in the format of WILDTRACK's annotations define; the files name none."""


@dataclass(frozen=True, slots=True, eq=False)
class TruthPiece:
    """The true positions of people, G rows."""

    source: Path
    format: str
    frames: Int[ndarray, " G"]
    ids: Int[ndarray, " G"]
    positions: Float[ndarray, "G 3"]
    """Positions in ``unit``; the third coordinate is NaN if the file has places on the floor."""
    unit: Unit | None = None
    up: Up | None = None
    fps: float | None = None
    begins: float | None = None
    """The time of frame 0 since the beginning of 1970, if the file has dates, seconds."""
    first_index: Literal[0, 1] | None = None
    valid: Bool[ndarray, " G"] | None = None
    cells: Int[ndarray, " G"] | None = None
    """The number of each row's place on a grid that the file does not define; ``positions`` are
    those of the first of :data:`GRIDS`."""
    left_out: str = ""
    """A sentence about rows of the file that have no place; empty where there are none."""
    feet: Mapping[str, Float[ndarray, "G 2"]] = field(default_factory=lambda: MappingProxyType({}))
    """By view the middle of the lower edge of each row's own box, pixels; NaN for none."""


@dataclass(frozen=True, slots=True, eq=False)
class VideoPiece:
    """One video file."""

    path: Path
    frames: int
    fps: float
    size: tuple[int, int]
    """Width and height of a picture as it is decoded, pixels."""
    rotated: bool = False
    """Whether the file asks players to rotate its pictures (``size`` is after the rotation)."""


@dataclass(frozen=True, slots=True, eq=False)
class ImagesPiece:
    """A folder of numbered pictures."""

    folder: Path
    files: tuple[Path, ...]
    """The pictures in the order of their numbers."""
    size: tuple[int, int]
    """Width and height of the first picture, pixels."""


@dataclass(frozen=True, slots=True, eq=False)
class TimesPiece:
    """The times of one camera's F frames."""

    source: Path
    camera: str
    """The number of the camera's port in the file; it may be empty."""
    times: Float[ndarray, " F"]
    """Times from a beginning that is common to all cameras, ascending, seconds."""


Piece = CalibrationPiece | DetectionPiece | TruthPiece | VideoPiece | ImagesPiece | TimesPiece
