"""Rotations that a file gives by three angles without saying how these are composed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from jaxtyping import Float
from numpy import ndarray

from tracker.checks.reading import turns_of
from tracker.formats.pieces import IN_DEGREES, INVERSE, FormatError, RawCamera


def told_turns(name: str) -> str:
    """How angles are composed, in words."""
    product = name.removesuffix(IN_DEGREES).removesuffix(INVERSE)
    leads = ", into the camera" if INVERSE in name else ""
    unit = IN_DEGREES if name.endswith(IN_DEGREES) else " in radians"
    if not product:
        return "a rotation vector"
    if set(product) == set("xyz"):
        return " ".join(f"R{axis}" for axis in product) + leads + unit
    return product + leads + unit


def chosen_turns(camera: RawCamera, wanted: str) -> Mapping[str, Float[ndarray, "3 3"]]:
    """Of the rotations that a camera's angles may be those that are wished.

    Raises:
        FormatError: If they cannot be composed so.
    """
    if wanted == "vector":
        wanted = ""
    found = {n: own for n, own in camera.turns.items() if n.removesuffix(IN_DEGREES) == wanted}
    if not found:
        choices = dict.fromkeys(n.removesuffix(IN_DEGREES) or "vector" for n in camera.turns)
        raise FormatError(f"{camera.name}: expected --euler {', '.join(choices)}, found {wanted}")
    return found


def check_turns(cameras: Sequence[RawCamera]) -> None:
    """Refuse angles whose order neither their names nor the boxes tell.

    Raises:
        FormatError: Saying what to give.
    """
    names = [name.removesuffix(IN_DEGREES) for name in turns_of(cameras)]
    if len(set(names)) > 1 and "" not in names:
        raise FormatError(
            f"{cameras[0].name}: its rotation is three angles, and neither their names nor boxes "
            f"of people tell in which order they turn; --euler says it ({', '.join(names)}), "
            "where zyx is R = Rz Ry Rx; or give the 3×3 matrix"
        )
