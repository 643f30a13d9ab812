"""Rotations given by three angles, or by a quaternion, without saying how these are meant."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from jaxtyping import Float
from numpy import ndarray

from tracker.io.conventions.reading import turns_of
from tracker.io.read.pieces import IN_DEGREES, INVERSE, FormatError, RawCamera

VECTOR = "vector"
"""What three angles are called that are a rotation vector."""


def open_turns(cameras: Sequence[RawCamera]) -> tuple[str, ...]:
    """How the angles of cameras may be composed, by the names that somebody says it with."""
    names = (name.removesuffix(IN_DEGREES) or VECTOR for name in turns_of(cameras))
    return tuple(dict.fromkeys(names))


def turns_in_words(name: str) -> str:
    """How angles are composed and measured, in words."""
    words = product_in_words(name)
    if not name or "w" in name:
        return words
    return words + (IN_DEGREES if name.endswith(IN_DEGREES) else " in radians")


def product_in_words(name: str) -> str:
    """How angles are composed, in words."""
    product = name.removesuffix(IN_DEGREES).removesuffix(INVERSE)
    if product in ("", VECTOR):
        return "a rotation vector"
    leads = ", into the camera" if INVERSE in name else ""
    if "w" in product:
        return f"a quaternion {product}"
    if set(product) == set("xyz"):
        product = " ".join(f"R{axis}" for axis in product)
    return product + leads


def chosen_turns(camera: RawCamera, wanted: str) -> Mapping[str, Float[ndarray, "3 3"]]:
    """Of the rotations that a camera's angles may be those that are wished.

    Raises:
        FormatError: If they cannot be composed so.
    """
    name = "" if wanted == VECTOR else wanted
    found = {n: own for n, own in camera.turns.items() if n.removesuffix(IN_DEGREES) == name}
    if not found:
        choices = ", ".join(open_turns([camera]))
        raise FormatError(f"{camera.name}: expected --euler {choices}, found {wanted}")
    return found


def check_turns(cameras: Sequence[RawCamera]) -> None:
    """Refuse angles whose order neither their names nor the boxes tell.

    Raises:
        FormatError: Saying what to give.
    """
    names = open_turns(cameras)
    if len(names) > 1 and VECTOR not in names:
        raise FormatError(
            f"{cameras[0].name}: its rotation is three angles or a quaternion, and neither their "
            f"names nor boxes of people tell their order; --euler says it ({', '.join(names)}), "
            "where zyx is R = Rz Ry Rx; or give the 3×3 matrix"
        )
