"""A way to read somebody's calibration and boxes, and the cameras and boxes that follow from it."""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.geometry.calibration import size_around
from tracker.geometry.camera import Camera
from tracker.geometry.consistency.observed import Pose
from tracker.io.read.pieces import IN_DEGREES, METRES, Axes, Direction, Layout, RawCamera, Unit, Up

FLIP = np.diag([1.0, -1.0, -1.0])
"""Between OpenCV's camera axes (y down, z ahead) and OpenGL's (y up, z back), either way."""

MIRROR = np.diag([1.0, -1.0, 1.0])
"""From a left-handed world to a right-handed one."""

UPS: tuple[Up, ...] = ("x", "y", "z", "-x", "-y", "-z")


@dataclass(frozen=True, slots=True)
class Reading:
    """One way to read a calibration and its boxes."""

    direction: Direction = "world-to-camera"
    axes: Axes = "opencv"
    layout: Layout = "ltwh"
    parts: int = 0
    """In how many parts of the picture's width and height boxes are given: 1, 100 (per cent) or
    1000; 0 for pixels."""
    unit: Unit = "m"
    up: Up = "z"
    lean: tuple[float, float] = (0.0, 0.0)
    """x and y of the unit vector along which people stand once ``up`` is z: the world of a rig
    whose first camera is the origin leans as that camera does."""
    turns: str = ""
    """Of cameras whose rotations are given by angles: how these are composed."""
    order: tuple[int, ...] | None = None
    """Of each camera's boxes and pictures: whose calibration is theirs. None: their own."""
    mirrored: bool = False
    """Whether the calibration is of a left-handed world, in which people lie behind every camera;
    its y axis is mirrored to make it right-handed."""
    flipped: bool = False
    """Whether boxes are of pictures whose left and right are exchanged."""
    pixels: float = 1.0
    """The width of the pictures in which boxes are given, in that of the calibration's pictures."""


def pose(camera: RawCamera, reading: Reading) -> Pose:
    """Where a camera stands in its file's own world axes and unit.

    Raises:
        ValueError: If the file gives no pose.
    """
    stands = _pose(camera, reading)
    if reading.mirrored:
        return Pose(-stands.rotation @ MIRROR, MIRROR @ stands.centre)
    return stands


def _pose(camera: RawCamera, reading: Reading) -> Pose:
    """The pose in the world of the file, be it left-handed."""
    if camera.projection is not None:
        split = _split(camera)
        return Pose(split.rotation, split.centre)
    if camera.rotation is None or camera.translation is None:
        raise ValueError(f'camera "{camera.name}" has no pose: expected R and t, or a projection')
    rotation = np.asarray(camera.turns.get(reading.turns, camera.rotation), dtype=float)
    translation = np.asarray(camera.translation, dtype=float).reshape(3)
    if reading.direction in ("camera-to-world", "transposed"):
        rotation = rotation.T
    places = reading.direction in ("camera-to-world", "position")
    centre = translation if places else -rotation.T @ translation
    if reading.axes == "opengl":
        rotation = FLIP @ rotation
    return Pose(rotation, centre)


def turns_of(cameras: Many[RawCamera]) -> tuple[str, ...]:
    """How the angles of cameras may be composed, the likeliest first; ``""`` where there are none.

    Angles that are radians in one camera are not degrees in another.
    """
    told = [camera.turns for camera in cameras if camera.turns]
    if not told:
        return ("",)
    common = [name for name in told[0] if all(name in own for own in told)]
    radians = [name for name in common if name and not name.endswith(IN_DEGREES)]
    return tuple(n for n in common if not radians or n in radians or not n)


def upright(up: Up) -> Float[ndarray, "3 3"]:
    """The rotation that turns a world so that this axis points along z; the others stay near."""
    axis = np.zeros(3)
    axis["xyz".index(up[-1])] = -1.0 if up.startswith("-") else 1.0
    turns = {
        "z": np.eye(3),
        "-z": np.diag([1.0, -1.0, -1.0]),
        "y": np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]]),
        "-y": np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]]),
        "x": np.array([[0.0, 0, -1.0], [0, 1.0, 0], [1.0, 0, 0]]),
        "-x": np.array([[0.0, 0, 1.0], [0, 1.0, 0], [-1.0, 0, 0]]),
    }
    return np.asarray(turns[up])


def levelled(reading: Reading) -> Float[ndarray, "3 3"]:
    """The rotation from the file's world to one in which people stand along z."""
    x, y = reading.lean
    if x == y == 0.0:
        return upright(reading.up)
    z = float(np.sqrt(1.0 - x * x - y * y))
    # the smallest rotation that takes (x, y, z) to the z axis (Rodrigues)
    across = np.array([[0.0, 0.0, -x], [0.0, 0.0, -y], [x, y, 0.0]])
    turn = np.eye(3) + across + across @ across / (1.0 + z)
    return np.asarray(turn @ upright(reading.up))


def to_camera(camera: RawCamera, reading: Reading, image_size: tuple[int, int]) -> Camera:
    """The camera in metres, z up, world to camera, OpenCV axes.

    Raises:
        ValueError: If lens or pose are missing.
    """
    lens = lens_of(camera, image_size)
    stands = pose(camera, reading)
    to_world = levelled(reading)
    rotation = stands.rotation @ to_world.T
    centre = METRES[reading.unit] * to_world @ stands.centre
    return replace(lens, name=camera.name, rotation=rotation, translation=-rotation @ centre)


def lens_of(camera: RawCamera, image_size: tuple[int, int]) -> Camera:
    """A camera with the file's lens that stands at the origin and looks along z.

    Raises:
        ValueError: If the file gives no K.
    """
    if camera.projection is not None:
        intrinsics, distortion = _split(camera).intrinsics, np.zeros(5)
    elif camera.intrinsics is None:
        raise ValueError(f'camera "{camera.name}" has no lens: expected K, or a projection')
    else:
        intrinsics = np.asarray(camera.intrinsics, dtype=float)
        distortion = np.zeros(0) if camera.distortion is None else np.asarray(camera.distortion)
        if camera.lens != "fisheye":
            distortion = np.concatenate([distortion, np.zeros(max(0, 5 - len(distortion)))])
    fisheye = camera.lens == "fisheye"
    return Camera(camera.name, image_size, intrinsics, np.eye(3), np.zeros(3), distortion, fisheye)


def with_pixels(raw: RawCamera, factor: float) -> RawCamera:
    """The camera for pictures so many times as wide."""
    if factor == 1.0:
        return raw
    size = raw.image_size
    larger = None if size is None else (round(factor * size[0]), round(factor * size[1]))
    return replace(stretched(raw, factor, factor), image_size=larger)


def stretched(raw: RawCamera, across: float, down: float) -> RawCamera:
    """The lens for stretched pictures: pixels' corners, not centres, are scaled."""
    scale = np.array(
        [[across, 0.0, 0.5 * across - 0.5], [0.0, down, 0.5 * down - 0.5], [0.0, 0.0, 1.0]]
    )
    return replace(
        raw,
        projection=None if raw.projection is None else scale @ raw.projection,
        intrinsics=None if raw.intrinsics is None else scale @ raw.intrinsics,
    )


def _split(camera: RawCamera) -> Camera:
    assert camera.projection is not None
    return Camera.from_projection(camera.name, (1, 1), np.asarray(camera.projection, dtype=float))


def read_boxes(
    four: Float[ndarray, "D 4"],
    layout: Layout,
    scale: tuple[int, int] | None = None,
    parts: int = 1,
) -> Float[ndarray, "D 4"]:
    """Boxes as left, top, width, height in pixels.

    Args:
        four: The numbers as the file has them.
        layout: What they mean.
        scale: Width and height of the picture where they are parts of it.
        parts: How many parts each of these has then.
    """
    boxes = np.array(four, dtype=float)
    if layout == "yxyx":
        boxes = boxes[:, [1, 0, 3, 2]]
    if layout in ("xyxy", "yxyx"):
        boxes[:, 2:] -= boxes[:, :2]
    elif layout == "cxcywh":
        boxes[:, :2] -= boxes[:, 2:] / 2.0
    if scale is not None:
        boxes *= np.array([*scale, *scale], dtype=float) / parts
        boxes[:, :2] -= 0.5  # a part of the picture's size begins at the pixel's corner
    return boxes


def boxes_by(
    four: Float[ndarray, "D 4"], reading: Reading, size: tuple[int, int]
) -> Float[ndarray, "D 4"]:
    """Boxes as left, top, width, height in pixels, by a reading.

    Args:
        four: The numbers as the file has them.
        reading: How they are meant.
        size: Width and height of the pictures.
    """
    boxes = read_boxes(four, reading.layout, size if reading.parts else None, reading.parts)
    if reading.flipped:
        boxes[:, 0] = size[0] - 1.0 - boxes[:, 0] - boxes[:, 2]
    return boxes


def likely_size(camera: RawCamera) -> tuple[int, int]:
    """The picture's size where only the lens is known: the principal point is near its middle."""
    if camera.image_size is not None:
        return camera.image_size
    return size_around(lens_of(camera, (1, 1)).intrinsics[:2, 2])


def exchanged(order: Many[int], names: Many[str]) -> str:
    """Which cameras' calibrations are exchanged, in words."""
    told: list[str] = []
    for first, second in enumerate(order):
        if order[second] == first and first < second:
            told.append(f"{names[first]} and {names[second]}")
        elif order[second] != first:
            told.append(f"{names[first]} has that of {names[second]}")
    return ", ".join(told)


def exchanges(order: Many[int], names: Many[str]) -> list[tuple[str, str]]:
    """The same as exchanges of two, one after the other."""
    told: list[tuple[str, str]] = []
    now = list(range(len(order)))
    for place, wanted in enumerate(order):
        other = now.index(wanted)
        if other != place:
            now[place], now[other] = now[other], now[place]
            told.append((names[place], names[other]))
    return told
