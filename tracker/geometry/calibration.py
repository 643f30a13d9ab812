"""The parts of a camera's calibration, checked: whatever file they are from, the sentence is one.

Each function returns the part, or raises ``ValueError`` with what was expected and what was found;
the caller adds the file and the field.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.files.text import shown

Lens = Literal["pinhole", "rational", "fisheye"]

ROTATION_TOLERANCE = 2e-3
"""Largest deviation of R Rᵀ from the identity, which entries with three decimals meet."""

LEAST_FOCAL = 0.1
"""Least focal length, pixels; that of a real camera is about the size of its picture."""

LARGEST_ENTRY = 1e6
"""Largest entry of K, pixels; powers of larger ones could overflow."""

LARGEST_SIDE = 65535
"""Largest width and height of a picture, pixels."""

COUNTS = (0, 4, 5, 8, 12, 14)
"""The counts of numbers that OpenCV's lenses have, apart from the fisheye."""


def checked_intrinsics(
    matrix: Float[ndarray, "3 3"], *, rounding: float = 0.0
) -> Float[ndarray, "3 3"]:
    """Return K = [[fx, s, cx], [0, fy, cy], [0, 0, 1]], pixels.

    Args:
        matrix: K.
        rounding: By how much the last row and what is below the diagonal may be off.

    Raises:
        ValueError: If it is of another form, or a focal length is not positive.
    """
    below = matrix[[1, 2, 2], [0, 0, 1]]
    if np.abs(below).max() > rounding or abs(matrix[2, 2] - 1.0) > rounding:
        turned = "; it looks transposed" if matrix[0, 2] == matrix[1, 2] == 0.0 else ""
        raise ValueError(
            "expected [[fx, s, cx], [0, fy, cy], [0, 0, 1]] in pixels, found "
            f"{shown(matrix.tolist())}{turned}"
        )
    if matrix[0, 0] <= 0.0 or matrix[1, 1] <= 0.0:
        raise ValueError(
            "expected focal lengths fx and fy above 0 pixels, found "
            f"{matrix[0, 0]:g} and {matrix[1, 1]:g}"
        )
    found = matrix.copy()
    found[1, 0], found[2] = 0.0, (0.0, 0.0, 1.0)
    return found


def check_focal_lengths(matrix: Float[ndarray, "3 3"]) -> None:
    """Check that K is plausible, so that later computations do not overflow.

    Raises:
        ValueError: If it has an entry that is too large, or a focal length that is too small.
    """
    focal = matrix[[0, 1], [0, 1]]
    # not a number is neither at most the one nor at least the other
    if not (np.abs(matrix).max() <= LARGEST_ENTRY and focal.min() >= LEAST_FOCAL):
        raise ValueError(
            f"expected focal lengths fx and fy from {LEAST_FOCAL:g} to {LARGEST_ENTRY:g} pixels, "
            f"and nothing larger in K, found fx = {focal[0]:.4g}, fy = {focal[1]:.4g} and "
            f"{np.abs(matrix).max():.4g} at most"
        )


def is_rotation(matrix: Float[ndarray, "3 3"]) -> bool:
    """Whether R Rᵀ = 1 and the determinant is 1, as far as three decimals tell."""
    error = float(np.abs(matrix @ matrix.T - np.eye(3)).max())
    return error <= ROTATION_TOLERANCE and float(np.linalg.det(matrix)) > 0.0


def checked_rotation(matrix: Float[ndarray, "3 3"]) -> Float[ndarray, "3 3"]:
    """Return a rotation matrix.

    Raises:
        ValueError: If it is none, or a reflection.
    """
    error = float(np.abs(matrix @ matrix.T - np.eye(3)).max())
    with np.errstate(all="ignore"):  # the matrix may be far from a rotation
        determinant = float(np.linalg.det(matrix))
    if error > ROTATION_TOLERANCE:
        raise ValueError(
            "expected a rotation (R Rᵀ = 1, determinant 1), found "
            f"R Rᵀ off by {error:.2g} and determinant {determinant:.4g}; "
            "write it with more digits or calibrate again"
        )
    if determinant < 0.0:
        raise ValueError(
            "expected a rotation (determinant 1), found a reflection (determinant −1); "
            "one axis points the wrong way: camera axes are x right, y down, z ahead"
        )
    return matrix


def checked_distortion(
    found: Float[ndarray, " n"], *, fisheye: bool, counts: tuple[int, ...] = COUNTS
) -> tuple[Float[ndarray, " m"], Lens]:
    """Return the numbers of a lens in OpenCV's order, 4 of a fisheye, else 5 or 8, and its model.

    Args:
        found: k1 k2 k3 k4 of a fisheye; else k1 k2 p1 p2 [k3 [k4 k5 k6]]. None stand for zeros.
        fisheye: Whether the lens is a fisheye.
        counts: How many numbers a lens that is no fisheye may have.

    Raises:
        ValueError: If they are of another count, or of a model that cameras here do not have.
    """
    if fisheye:
        if len(found) not in (0, 4):
            raise ValueError(
                f"expected the 4 numbers of a fisheye (k1 k2 k3 k4), found {len(found)}"
            )
        return (found if len(found) else np.zeros(4)), "fisheye"
    if len(found) not in counts:
        raise ValueError(
            f"expected 4, 5 or 8 numbers (k1 k2 p1 p2 [k3 [k4 k5 k6]]), found {len(found)}"
        )
    if found[8:].any():
        raise ValueError(
            "expected at most 8 numbers other than 0 (k1 k2 p1 p2 k3 k4 k5 k6), found "
            f"{len(found)}; calibrate with the rational or the plain lens model"
        )
    if found[5:].any():
        return found[:8], "rational"
    return np.pad(found[:5], (0, max(0, 5 - len(found)))), "pinhole"


def size_around(principal_point: Float[ndarray, " 2"]) -> tuple[int, int]:
    """Return the size of pictures in whose middle a principal point lies, pixels."""
    sides = np.clip(np.round(2.0 * principal_point + 1.0), 2.0, LARGEST_SIDE)
    return int(sides[0]), int(sides[1])


def checked_size(found: Float[ndarray, " 2"]) -> tuple[int, int]:
    """Return width and height of a picture, pixels.

    Raises:
        ValueError: If they are not two whole numbers within the limit.
    """
    width, height = found.tolist()
    if not all(side == round(side) and 1 <= side <= LARGEST_SIDE for side in (width, height)):
        raise ValueError(
            f"expected two whole numbers of pixels up to {LARGEST_SIDE}, found {width:g} and "
            f"{height:g}"
        )
    return int(width), int(height)
