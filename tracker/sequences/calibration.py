"""The calibration of one camera in ``sequence.toml``, with its validation."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.files.text import shown
from tracker.geometry.camera import Camera
from tracker.sequences.errors import SequenceError
from tracker.sequences.fields import LARGEST, Fields, listed
from tracker.sequences.sequence import Room

POSE = ("K", "distortion", "lens", "R", "t")
"""The fields of a calibration without ``projection``."""

LEAST_FOCAL = 0.1
"""Least focal length, pixels; that of a real camera is about the size of its picture."""

ROTATION_TOLERANCE = 2e-3
"""Largest deviation of R Rᵀ from the identity, which entries with three decimals meet."""


def read_camera(name: str, image_size: tuple[int, int], fields: Fields) -> Camera:
    """Read the calibration of one ``[[camera]]`` table.

    Args:
        name: The camera's name.
        image_size: Width and height of its pictures, pixels.
        fields: The table.

    Raises:
        SequenceError: If the calibration is incomplete, of the wrong shape, or impossible.
    """
    if "projection" in fields:
        both = [key for key in POSE if key in fields]
        if both:
            raise fields.error(
                "projection", f"stands in place of {listed(both)}; remove one or the other"
            )
        projection = fields.matrix("projection", 3, 4)
        try:
            with np.errstate(all="ignore"):
                camera = Camera.from_projection(name, image_size, projection)
        except ValueError as error:
            raise fields.error("projection", str(error)) from None
        _check_size(fields, "projection", camera.intrinsics)
        if not np.abs(camera.translation).max() <= LARGEST:
            raise fields.error(
                "projection",
                f"expected a camera within {LARGEST:g} m of the origin, found one at "
                f"{np.abs(camera.translation).max():.4g} m",
            )
        return camera
    missing = [key for key in ("K", "R", "t") if key not in fields]
    if missing:
        raise SequenceError(
            f"{fields.where}: the calibration is incomplete: expected K, R and t, or projection; "
            f"{listed(missing)} {'is' if len(missing) == 1 else 'are'} missing"
        )
    lens = fields.text("lens", "plain")
    if lens not in ("plain", "fisheye"):
        raise fields.error("lens", f'expected "plain" or "fisheye", found {shown(lens)}')
    return Camera(
        name,
        image_size,
        _intrinsics(fields),
        _rotation(fields),
        fields.vector("t", 3, "metres, in camera axes"),
        _distortion(fields, fisheye=lens == "fisheye"),
        fisheye=lens == "fisheye",
    )


def _intrinsics(fields: Fields) -> Float[ndarray, "3 3"]:
    """Read and check the matrix of intrinsics, pixels."""
    matrix = fields.matrix("K", 3, 3)
    form = "[[fx, s, cx], [0, fy, cy], [0, 0, 1]] in pixels"
    if matrix[1, 0] or matrix[2, 0] or matrix[2, 1] or matrix[2, 2] != 1.0:
        turned = "; it looks transposed" if matrix[0, 2] == matrix[1, 2] == 0.0 else ""
        raise fields.error("K", f"expected {form}, found {shown(matrix.tolist())}{turned}")
    if matrix[0, 0] <= 0.0 or matrix[1, 1] <= 0.0:
        found = f"{matrix[0, 0]:g} and {matrix[1, 1]:g}"
        raise fields.error("K", f"expected focal lengths fx and fy above 0 pixels, found {found}")
    _check_size(fields, "K", matrix)
    return matrix


def _check_size(fields: Fields, field: str, matrix: Float[ndarray, "3 3"]) -> None:
    """Check that K is plausible, so that later computations do not overflow."""
    focal = matrix[[0, 1], [0, 1]]
    if not (np.abs(matrix).max() <= LARGEST and focal.min() >= LEAST_FOCAL):
        raise fields.error(
            field,
            f"expected focal lengths fx and fy from {LEAST_FOCAL:g} to {LARGEST:g} pixels, and "
            f"nothing larger in K, found fx = {focal[0]:.4g}, fy = {focal[1]:.4g} and "
            f"{np.abs(matrix).max():.4g} at most",
        )


def _rotation(fields: Fields) -> Float[ndarray, "3 3"]:
    """Read and check the rotation from world to camera axes."""
    matrix = fields.matrix("R", 3, 3)
    error = float(np.abs(matrix @ matrix.T - np.eye(3)).max())
    with np.errstate(all="ignore"):  # the matrix may be far from a rotation
        determinant = float(np.linalg.det(matrix))
    if error > ROTATION_TOLERANCE:
        raise fields.error(
            "R",
            "expected a rotation (R Rᵀ = 1, determinant 1), found "
            f"R Rᵀ off by {error:.2g} and determinant {determinant:.4g}; "
            "write it with more digits or calibrate again",
        )
    if determinant < 0.0:
        raise fields.error(
            "R",
            "expected a rotation (determinant 1), found a reflection (determinant −1); "
            "one axis points the wrong way: camera axes are x right, y down, z ahead",
        )
    return matrix


def _distortion(fields: Fields, *, fisheye: bool) -> Float[ndarray, " n"]:
    """Read the coefficients of the lens distortion in OpenCV's order: 4 of a fisheye, else 5 or
    8."""
    given = fields.numbers("distortion")
    if fisheye:
        if len(given) not in (0, 4):
            raise fields.error(
                "distortion",
                f"expected the 4 numbers of a fisheye (k1 k2 k3 k4), found {len(given)}",
            )
        return given if len(given) else np.zeros(4)
    if len(given) not in (0, 4, 5, 8, 12, 14):
        raise fields.error(
            "distortion",
            f"expected 4, 5 or 8 numbers (k1 k2 p1 p2 [k3 [k4 k5 k6]]), found {len(given)}",
        )
    if given[8:].any():
        raise fields.error(
            "distortion",
            "expected at most 8 numbers other than 0 (k1 k2 p1 p2 k3 k4 k5 k6), found "
            f"{len(given)}; calibrate with the rational or the plain lens model",
        )
    if given[5:].any():
        return given[:8]
    return np.concatenate([given[:5], np.zeros(max(0, 5 - len(given)))])


def check_view_of_room(camera: Camera, room: Room) -> Iterator[str]:
    """Yield a warning if a camera sees nothing of the room, usually since its pose is inverted."""
    steps = np.linspace(0.0, 1.0, 13)
    grid = np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(-1, 3)
    if not camera.sees(room.minimum + grid * (room.maximum - room.minimum)).any():
        yield (
            f'camera "{camera.name}" sees nothing of the room: check that R and t lead from world '
            "to camera (x_cam = R x_world + t), that t is in metres, and [room]"
        )
