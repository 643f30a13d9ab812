"""Matrices, vectors and lens models from the fields of a file, validated."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any, ParamSpec, TypeVar

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.files.text import shown
from tracker.geometry import calibration as geometry
from tracker.geometry.calibration import Lens
from tracker.io.read.source import SourceFile

MOST_TURNED = 1000.0
"""Of a rotation vector's numbers: radians, or degrees by mistake."""

ROUNDED_ZERO = 1e-9
"""An entry of K below the diagonal that is zero but for rounding, pixels."""

COUNTS = (0, 1, 2, *geometry.COUNTS[1:])
"""The counts of numbers of a lens; some programs have only k1, or k1 and k2."""

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
"""The pattern of a number in a text."""


_P = ParamSpec("_P")
_T = TypeVar("_T")


def _checked(
    file: SourceFile,
    field: str,
    check: Callable[_P, _T],
    *parts: _P.args,
    **options: _P.kwargs,
) -> _T:
    """What a check of :mod:`tracker.geometry.calibration` returns; its error names the field."""
    try:
        return check(*parts, **options)
    except ValueError as error:
        raise file.error(str(error), field) from None


def plain(name: str) -> str:
    """A field's or a column's name without case, blanks, brackets and underscores."""
    return re.sub(r"[^a-z0-9]", "", name.lower())


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
    given = matrix(file, field, value, 3, 3)
    return _checked(file, field, geometry.checked_intrinsics, given, rounding=ROUNDED_ZERO)


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
    return _checked(file, field, geometry.checked_rotation, found.reshape(3, 3))


def lens(
    file: SourceFile, field: str, value: Any, *, fisheye: bool = False
) -> tuple[Float[ndarray, " n"], Lens]:
    """The lens in OpenCV's order, and which of its models it is.

    Raises:
        FormatError: If it is a model that cameras here do not have, by its name.
    """
    found = numbers(file, field, [] if value is None else value)
    return _checked(file, field, geometry.checked_distortion, found, fisheye=fisheye, counts=COUNTS)


def image_size(file: SourceFile, field: str, value: Any) -> tuple[int, int]:
    """Width and height, pixels; of a table those of its fields that are called so.

    Raises:
        FormatError: If they are not two whole numbers from 1 to 65535.
    """
    if isinstance(value, Mapping):
        by_name = {str(key).lower(): one for key, one in value.items()}
        value = [by_name.get(side, by_name.get(side[0])) for side in ("width", "height")]
    found = vector(file, field, value, 2, "width and height")
    return _checked(file, field, geometry.checked_size, found)


def stated_size(width: Any, height: Any) -> tuple[int, int] | None:
    """Width and height beside boxes, pixels; None where they are missing or those of no picture."""
    try:
        return geometry.checked_size(np.array([width, height], dtype=float))
    except (ValueError, TypeError, OverflowError):
        return None


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
    """Whether it is a list of tables (or an empty one), by its first hundred items."""
    return isinstance(value, list) and all(isinstance(item, dict) for item in value[:100])


def tables(file: SourceFile, field: str, value: Any) -> list[dict[str, Any]]:
    """The tables of a list.

    Raises:
        FormatError: If it is anything else.
    """
    if not is_list_of_tables(value):
        raise file.error(
            f"expected a list of tables, found {shown(value)}; it may be spoilt: get the file "
            "again",
            field,
        )
    found: list[dict[str, Any]] = value
    return found


def field_of(value: Any, name: str) -> Any:
    """What a table has in a field; None where there is none, or no table."""
    return value.get(name) if isinstance(value, Mapping) else None
