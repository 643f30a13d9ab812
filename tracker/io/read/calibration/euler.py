"""Rotations given by three angles: every rotation that they may be, by how they are composed.

With R_x(a) the turn by a about x, six products of three turns are in use, and programs seldom say
which is theirs; nor whether R leads into the camera or out of it. What is not said stays open:
the boxes tell which of them lets them meet.

The conventions that have a name of their own:

- ω, φ, κ of photogrammetry: R = R_x(ω) R_y(φ) R_z(κ) out of a camera with y up and z back.
- ``rotation_euler`` of Blender in its mode XYZ: R = R_z R_y R_x, of such a camera too.
- yaw, pitch, roll: of a body with x ahead and z up (``flu``) or down (``frd``),
  R_z(yaw) R_y(pitch) R_x(roll); of a camera (``ypr``), R_y(yaw) R_x(pitch) R_z(roll); or of
  any axes with roll about x, pitch about y and yaw about z.

Sources: Kraus, "Photogrammetry", 2nd ed. 2007, section 2.1.2; Diebel, "Representing attitude",
2006, section 5; Blender, "Python API", ``Object.rotation_euler``.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.io.read.pieces import IN_DEGREES, INVERSE
from tracker.io.read.source import SourceFile
from tracker.io.read.values import rotation, vector

ORDERS = tuple("".join(letters) for letters in itertools.permutations("xyz"))
"""``zyx`` is R = R_z R_y R_x."""

KINDS = ("rxyz", "euler", *(f"euler{order}" for order in ORDERS), "blender", "ypr", "rpy", "opk")
"""Fields of three angles, by what their names say: nothing, not even that they are no rotation
vector; that they are Euler's; and the conventions with a name."""

NAMED_AXES = ("blender", "opk")
"""Of these the camera's y points up, and R leads out of the camera."""

FULL_TURN = 2.0 * math.pi * 1.01
"""Radians, with room for rounding; larger angles, or a longer rotation vector, are in degrees."""

_BODIES = {
    "flu": np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]),
    "frd": np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
}
"""From a camera that looks ahead to the body that carries it."""

_Turns = dict[str, Float[ndarray, "3 3"]]


def turns(file: SourceFile, field: str, fields: Mapping[str, Any], *, inverse: bool) -> _Turns:
    """Every rotation that the angles among a camera's fields may be; empty where there are none.

    Args:
        file: Where they are from.
        field: What a message calls them.
        fields: By meaning; those of :data:`KINDS` count.
        inverse: Whether R may lead into the camera though the camera's place is given.

    Returns:
        By the product's letters, with :data:`INVERSE` and :data:`IN_DEGREES` behind them; ``""``
        is the rotation vector that they may be.

    Raises:
        FormatError: If they are no three numbers.
    """
    kind = next((name for name in KINDS if name in fields), None)
    if kind is None:
        return {}
    three = vector(file, field, fields[kind], 3, "three angles")
    found: _Turns = {}
    units = ["", IN_DEGREES] if np.abs(three).max() <= FULL_TURN else [IN_DEGREES]
    for unit in units:
        angles = np.radians(three) if unit else three
        for name, turned in _products(kind, angles):
            found[name + unit] = turned
            if inverse and kind not in NAMED_AXES:
                found[name + INVERSE + unit] = turned.T
    if kind == "rxyz":
        long = float(np.linalg.norm(three)) > FULL_TURN
        as_vector = rotation(file, field, np.radians(three) if long else three)
        return {"": as_vector, **found}
    return found


def _products(kind: str, three: Float[ndarray, " 3"]) -> Iterator[tuple[str, ndarray]]:
    """The rotations of three angles in radians, the likeliest first."""
    if kind == "opk":
        yield "xyz", product("xyz", three)
    elif kind == "blender":
        yield "zyx", product("zyx", three)
    elif kind in ("ypr", "rpy"):
        roll_pitch_yaw = three[::-1] if kind == "ypr" else three
        body = product("zyx", roll_pitch_yaw)
        for name, ahead in _BODIES.items():
            yield name, body @ ahead
        roll, pitch, yaw = roll_pitch_yaw
        yield "ypr", product("yxz", np.array([pitch, yaw, roll]))
        yield from _products("euler", roll_pitch_yaw)
    elif kind.startswith("euler") and kind != "euler":
        letters = kind.removeprefix("euler")
        by_axis = np.array([three[letters.index(axis)] for axis in "xyz"])
        # the letters may name turns about axes that turn along, or about those that stand
        for order in (letters, letters[::-1]):
            yield order, product(order, by_axis)
    else:
        for order in ORDERS[::-1]:
            yield order, product(order, three)


def product(order: str, three: Float[ndarray, " 3"]) -> Float[ndarray, "3 3"]:
    """The product of turns about axes in this order, by angles about x, y and z in radians."""
    from scipy.spatial.transform import Rotation  # a server starts without it

    by_axis = dict(zip("xyz", three, strict=True))
    turned = Rotation.from_euler(order.upper(), [by_axis[axis] for axis in order])
    return np.asarray(turned.as_matrix())
