"""What the poses alone tell of how they are meant, where no boxes do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.geometry.camera import Camera
from tracker.io.conventions.level import LEVEL, horizon, leaning, upwards
from tracker.io.conventions.reading import Reading, pose, turns_of, upright
from tracker.io.read.pieces import METRES, Axes, Direction, FormatError, RawCamera, Unit
from tracker.sequences.fields import LARGEST

_USUAL_WAY = 5.0
"""Metres from a camera to the middle of what it looks at."""


def check_places(cameras: Sequence[Camera], calibration: str) -> None:
    """Refuse cameras so far away that no sequence takes them.

    Args:
        cameras: In metres.
        calibration: What their file was recognised as.

    Raises:
        FormatError: Naming the camera.
    """
    for camera in cameras:
        if not np.abs(camera.translation).max() <= LARGEST:
            raise FormatError(
                f"{calibration}, {camera.name}: expected a camera within {LARGEST:g} m of the "
                f"origin, found one at {np.abs(camera.translation).max():.4g} m; --unit mm or cm "
                "says what its numbers are, or take the offset of the coordinates off"
            )


def check_lenses(cameras: Sequence[RawCamera], calibration: str) -> None:
    """Refuse lenses with numbers so large that no sequence takes them.

    Args:
        cameras: As the file has them.
        calibration: What their file was recognised as.

    Raises:
        FormatError: Naming the camera.
    """
    for camera in cameras:
        for what, given in (("K", camera.intrinsics), ("distortion", camera.distortion)):
            largest = 0.0 if given is None else float(np.abs(given).max(initial=0.0))
            if not largest <= LARGEST:
                raise FormatError(
                    f"{calibration}, {camera.name}: expected numbers of at most {LARGEST:g} in "
                    f"its {what}, found {largest:.4g}"
                )


def read_poses(cameras: Sequence[RawCamera], *, boxes: bool) -> Reading:
    """The reading in which cameras look at one place in front of all of them.

    What the files state is not questioned. Up is where the cameras have up, and the unit the
    one in which they are a few metres from what they look at.

    Args:
        cameras: As the file has them.
        boxes: Whether there are boxes, which meet nowhere: then something else is wrong with the
            poses, and they do not tell what is level.
    """
    convention = cameras[0].convention
    directions: tuple[Direction, ...] = ("world-to-camera", "camera-to-world")
    axes: tuple[Axes, ...] = ("opencv", "opengl")
    if convention.direction is not None:
        directions = (convention.direction,)
    if convention.axes is not None:
        axes = (convention.axes,)
    readings = [
        Reading(direction=d, axes=a, turns=t)
        for t in turns_of(cameras)[:1]  # where they look does not tell which it is
        for a in axes
        for d in directions
    ]
    best = max(readings, key=lambda reading: _converging(cameras, reading))
    poses = [pose(camera, best) for camera in cameras]
    level = None if boxes else horizon(poses)
    ahead = -np.mean([own.rotation[1] for own in poses], axis=0) if level is None else level
    up = convention.up or upwards(ahead)
    lean = (0.0, 0.0)
    if convention.up is None and level is not None:
        lean = leaning(upright(up) @ level, 2.0 * LEVEL)  # cameras may be rolled a little
    centres = np.array([own.centre for own in poses])
    way = float(np.median(np.linalg.norm(centres - _focus(cameras, best), axis=1)))
    units: tuple[Unit, ...] = ("m", "cm", "mm")
    if convention.unit is not None:
        units = (convention.unit,)
    off = [abs(float(np.log(max(METRES[one] * way, 1e-9) / _USUAL_WAY))) for one in units]
    unit = units[int(np.argmin(off))]
    return replace(best, unit=unit, up=up, lean=lean)


def _focus(cameras: Sequence[RawCamera], reading: Reading) -> Float[ndarray, " 3"]:
    """The place that is nearest to the optical axes of all, in the sense of least squares."""
    total, side = 1e-9 * np.eye(3), np.zeros(3)
    for camera in cameras:
        own = pose(camera, reading)
        across = np.eye(3) - np.outer(own.rotation[2], own.rotation[2])
        total, side = total + across, side + across @ own.centre
    return np.asarray(np.linalg.solve(total, side))


def _converging(cameras: Sequence[RawCamera], reading: Reading) -> float:
    """Cosines, summed, between where each camera looks and where that place is."""
    focus = _focus(cameras, reading)
    total = 0.0
    for camera in cameras:
        own = pose(camera, reading)
        way = focus - own.centre
        length = float(np.linalg.norm(way))
        total += float(own.rotation[2] @ way) / length if length > 0.0 else 0.0
    return total
