"""Matrices, vectors and lenses out of what a file has in a field, checked."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.files.text import shown
from tracker.io.read.pieces import Lens
from tracker.io.read.source import SourceFile

ROTATION_TOLERANCE = 2e-3
"""How far R Rᵀ may be from the identity: entries written with three decimals pass."""

ROUNDED_ZERO = 1e-9
"""An entry of K below the diagonal that is zero but for rounding, pixels."""

MOST_TURNED = 1000.0
"""Of a rotation vector's numbers: radians, or degrees by mistake."""

LARGEST_SIDE = 65535
"""Pixels."""


NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
"""The pattern of a number in a text."""


def numbers_in(value: Any) -> Float[ndarray, " n"] | None:
    """All numbers of a list of any nesting, or of a text with blanks or commas between them; None
    if something else is among them."""
    if isinstance(value, str):
        value = value.replace(",", " ").split()
    try:
        return np.asarray(value, dtype=float).ravel()
    except (ValueError, TypeError):
        return None


def numbers(
    file: SourceFile, field: str, value: Any, *, missing: bool = False
) -> Float[ndarray, " n"]:
    """All numbers of a list of any nesting, or of a text with blanks or commas between them.

    Args:
        file: The file, for the message.
        field: The name of the field, for the message.
        value: What the file has there.
        missing: Whether NaN is one of the values: what was not measured.

    Raises:
        FormatError: If something else is among them.
    """
    found = numbers_in(value)
    if found is None:
        raise file.error(f"expected numbers, found {shown(value)}", field)
    if not (np.isfinite(found) | (missing & np.isnan(found))).all():
        raise file.error(f"expected finite numbers, found {shown(value)}", field)
    return found


def vector(
    file: SourceFile, field: str, value: Any, length: int, what: str
) -> Float[ndarray, " length"]:
    """``length`` numbers.

    Raises:
        FormatError: If there are more or fewer.
    """
    found = numbers(file, field, value)
    if len(found) != length:
        raise file.error(f"expected {length} numbers ({what}), found {len(found)}", field)
    return found


def matrix(
    file: SourceFile, field: str, value: Any, rows: int, columns: int
) -> Float[ndarray, "rows columns"]:
    """A matrix, by rows, as a nested or flat list.

    Raises:
        FormatError: If the count of numbers is another.
    """
    what = f"a {rows}×{columns} matrix"
    return vector(file, field, value, rows * columns, what).reshape(rows, columns)


def intrinsics(file: SourceFile, field: str, value: Any) -> Float[ndarray, "3 3"]:
    """K = [[fx, s, cx], [0, fy, cy], [0, 0, 1]], pixels.

    Raises:
        FormatError: If it is of another form.
    """
    found = matrix(file, field, value, 3, 3)
    form = "[[fx, s, cx], [0, fy, cy], [0, 0, 1]] in pixels"
    below = found[[1, 2, 2], [0, 0, 1]]
    if np.abs(below).max() > ROUNDED_ZERO or abs(found[2, 2] - 1.0) > 1e-9:
        raise file.error(f"expected {form}, found {shown(found.tolist())}", field)
    found[[1, 2, 2], [0, 0, 1]] = 0.0
    if found[0, 0] <= 0.0 or found[1, 1] <= 0.0:
        raise file.error(
            f"expected focal lengths above 0 pixels, found {found[0, 0]:g} and {found[1, 1]:g}",
            field,
        )
    return found


def focal_and_centre(fx: float, fy: float, cx: float, cy: float) -> Float[ndarray, "3 3"]:
    """K from its four numbers, pixels."""
    return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])


def rotation(file: SourceFile, field: str, value: Any) -> Float[ndarray, "3 3"]:
    """A rotation matrix, or Rodrigues' vector of three angles in radians.

    Raises:
        FormatError: If it is neither, or a reflection.
    """
    from scipy.spatial.transform import Rotation  # a server starts without it

    found = numbers(file, field, value)
    if len(found) == 3:
        if np.abs(found).max() > MOST_TURNED:
            raise file.error(
                f"expected a rotation vector in radians, found {shown(found.tolist())}", field
            )
        return np.asarray(Rotation.from_rotvec(found).as_matrix())
    if len(found) != 9:
        raise file.error(
            f"expected a 3×3 matrix or a rotation vector, found {len(found)} numbers", field
        )
    turned = found.reshape(3, 3)
    if not is_rotation(turned):
        raise file.error(
            "expected a rotation (R Rᵀ = 1, determinant 1), found R Rᵀ off by "
            f"{np.abs(turned @ turned.T - np.eye(3)).max():.2g} and determinant "
            f"{np.linalg.det(turned):.4g}",
            field,
        )
    return turned


def is_rotation(found: Float[ndarray, "3 3"]) -> bool:
    """Whether R Rᵀ = 1 and the determinant is 1, as far as three decimals tell."""
    error = float(np.abs(found @ found.T - np.eye(3)).max())
    return error <= ROTATION_TOLERANCE and float(np.linalg.det(found)) > 0.0


def lens(
    file: SourceFile, field: str, value: Any, *, fisheye: bool = False
) -> tuple[Float[ndarray, " n"], Lens]:
    """The lens in OpenCV's order, and which of its models it is.

    Raises:
        FormatError: If it is a model that cameras here do not have, by its name.
    """
    found = numbers(file, field, [] if value is None else value)
    if fisheye:
        if len(found) not in (0, 4):
            raise file.error(
                f"expected the 4 numbers of a fisheye (k1 k2 k3 k4), found {len(found)}", field
            )
        return (found if len(found) else np.zeros(4)), "fisheye"
    if len(found) not in (0, 1, 2, 4, 5, 8, 12, 14):
        raise file.error(
            f"expected 4, 5 or 8 numbers (k1 k2 p1 p2 [k3 [k4 k5 k6]]), found {len(found)}", field
        )
    if len(found) > 8 and found[8:].any():
        raise file.error(
            "has a thin-prism or tilted lens (s1 … τy of OpenCV's 12 or 14 numbers), expected at "
            "most 8; calibrate again with the rational or the plain model",
            field,
        )
    found = found[:8]
    if len(found) == 8 and found[5:].any():
        return found, "rational"
    plain = np.zeros(5)
    plain[: min(5, len(found))] = found[:5]
    return plain, "pinhole"


def image_size(file: SourceFile, field: str, value: Any) -> tuple[int, int]:
    """Width and height, pixels; of a table those of its fields that are called so.

    Raises:
        FormatError: If they are not two whole numbers from 1 to 65535.
    """
    if isinstance(value, Mapping):
        by_name = {str(key).lower(): one for key, one in value.items()}
        value = [by_name.get(side, by_name.get(side[0])) for side in ("width", "height")]
    found = vector(file, field, value, 2, "width and height")
    if (found != np.round(found)).any() or (found < 1).any() or (found > LARGEST_SIDE).any():
        raise file.error(
            f"expected two whole numbers of pixels up to {LARGEST_SIDE}, found {shown(value)}",
            field,
        )
    return int(found[0]), int(found[1])


def number(file: SourceFile, field: str, value: Any) -> float:
    """One finite number.

    Raises:
        FormatError: If it is none.
    """
    return float(vector(file, field, [value], 1, "one number")[0])


def need(file: SourceFile, table: Any, names: Iterable[str], where: str = "") -> None:
    """Refuse a table in which one of the fields is missing.

    Raises:
        FormatError: Naming what is missing, all at once.
    """
    if not isinstance(table, dict):
        raise file.error(f"expected a table of fields, found {shown(table)}", where)
    missing = [name for name in names if name not in table]
    if missing:
        raise file.error(f"expected the fields {', '.join(missing)}, which are missing", where)


def is_list_of_tables(value: Any) -> bool:
    """Whether it is a list that begins with a table (or is empty)."""
    return isinstance(value, list) and all(isinstance(item, dict) for item in value[:100])
