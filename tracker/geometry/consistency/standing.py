"""Head and foot of an upright person in an image, from a box that is parallel to the image.

A detector's box touches the person on four sides. In a level camera that looks straight ahead its
top and bottom are head and foot. In a camera that is rolled by a quarter, left and right are; in
one that is slanted, none is: a body with the length L and the breadth T, which lies along the unit
vector d in the image, has as an ellipse the box

    height² = L² d_y² + T² d_x²,        width² = L² d_x² + T² d_y²,

which is solved for L and T. Seen from above, the ends of the body lie inside its outline. Of an
ellipsoid with the semi-axes h (upright) and r, whose middle is at the distance D along a ray at the
angle φ to the way up, the outline's ends lie at the angles α from that ray where

    (D² − r² sin² φ − h² cos² φ) tan² α + 2 (h² − r²) sin φ cos φ tan α = r² cos² φ + h² sin² φ

(the tangents from a point to an ellipse); to second order in h / D they are apart by 2 θ with
D² sin² θ = r² cos² φ + h² sin² φ, and their bisector is off the middle by
(r² − h²) sin φ cos φ / D².

[ZBS17] Zhang, Benenson, Schiele, "CityPersons: a diverse dataset for pedestrian detection", CVPR
2017, whose boxes of people are 0.41 times as wide as high.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from tracker.geometry.camera import Camera

# Halved and doubled, the constants below leave all interpretations of the random rooms of seeds
# 1300 … 1303 as they are, correct and with one mistake each, and their estimates to within 2 mm.
# The breadth is halved only: above 1 a body would be broader than long.
_SLIMMEST, _BROADEST = 0.2, 0.8  # bounds of T / L, of people and of parts of them
_USUAL = 0.4  # T / L where the box does not determine it [ZBS17]
_APART = 0.25  # least difference of d_x² and d_y² for which L and T are determined
_LEAST_SINE = 0.25  # least sin φ: a person seen from above shows no height
_STEP = 1e-3  # change of a unit direction for the numerical derivative of its pixel


def sides(boxes: Float[ndarray, "D 4"], turn: int) -> tuple[ndarray, ndarray]:
    """The middles of the side with the head and of the opposite side, two arrays (D, 2), pixels.

    Args:
        boxes: Left, top, width, height of D boxes, pixels.
        turn: Side with the head: 0 for the top, 1 the right, 2 the bottom, 3 the left.
    """
    middle = boxes[:, :2] + boxes[:, 2:] / 2.0
    half = np.zeros((len(boxes), 2))
    along = turn % 2
    half[:, 1 - along] = boxes[:, 3 - along] / 2.0 * (-1.0 if turn in (0, 3) else 1.0)
    return middle + half, middle - half


def turn_of(up: Float[ndarray, " 3"]) -> int:
    """The side of a box with the head, as in :func:`sides`, for a vertical in camera axes."""
    if abs(up[1]) >= abs(up[0]):
        return 0 if up[1] <= 0.0 else 2
    return 1 if up[0] > 0.0 else 3


def ends(
    boxes: Float[ndarray, "D 4"], lens: Camera, up: Float[ndarray, " 3"]
) -> tuple[Float[ndarray, "D 3"], Float[ndarray, "D 3"], Bool[ndarray, " D"]]:
    """Compute unit directions to head and foot of upright people, in camera axes.

    Args:
        boxes: Left, top, width, height of D boxes, pixels.
        lens: The camera, whose pose has no effect.
        up: Vertical direction, a unit vector in camera axes.

    Returns:
        Directions to heads and to feet, and whether the vertical is visible in the image there.
    """
    own = replace(lens, rotation=np.eye(3), translation=np.zeros(3))
    middle = boxes[:, :2] + boxes[:, 2:] / 2.0
    along, good = _along(own, own.back_project(np.nan_to_num(middle)), up)
    parts = along**2  # d_x², d_y²
    upright = parts[:, 1] >= parts[:, 0]
    main = np.where(upright, parts[:, 1], parts[:, 0])
    other = 1.0 - main
    squares = np.square(boxes[:, 2:])
    long = np.where(upright, squares[:, 1], squares[:, 0])
    short = np.where(upright, squares[:, 0], squares[:, 1])
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = (short * main - long * other) / (long * main - short * other)  # T² / L²
    ratio = np.where((main - other > _APART) & np.isfinite(ratio), ratio, _USUAL**2)
    ratio = np.clip(ratio, _SLIMMEST**2, _BROADEST**2)
    half = along * np.sqrt(long / (main + ratio * other))[:, None] / 2.0
    top, bottom = (own.back_project(np.nan_to_num(end)) for end in (middle + half, middle - half))
    bisector = top + bottom
    bisector /= np.linalg.norm(bisector, axis=1, keepdims=True)
    cosine = bisector @ up
    sine = np.sqrt(np.maximum(1.0 - cosine**2, _LEAST_SINE**2))
    shown = np.linalg.norm(top - bottom, axis=1) / 2.0  # sin θ
    kept = 1.0 - ratio * cosine**2  # h² sin² φ / (D² sin² θ)
    size = shown * np.sqrt(kept) / sine  # h / D
    slenderness = ratio * sine**2 / kept  # r² / h²
    across = (up - cosine[:, None] * bisector) / sine[:, None]
    off = -cosine * sine * size**2 * (1.0 - slenderness)
    ahead = bisector - off[:, None] * across
    heads, feet = ahead + size[:, None] * up, ahead - size[:, None] * up
    heads /= np.linalg.norm(heads, axis=1, keepdims=True)
    feet /= np.linalg.norm(feet, axis=1, keepdims=True)
    return heads, feet, good


def _along(
    lens: Camera, rays: Float[ndarray, "D 3"], up: Float[ndarray, " 3"]
) -> tuple[Float[ndarray, "D 2"], Bool[ndarray, " D"]]:
    """The vertical direction in the image at some rays, and whether it is visible there."""
    across = up - (rays @ up)[:, None] * rays
    sine = np.linalg.norm(across, axis=1)
    across /= np.maximum(sine, 1e-9)[:, None]
    before, good = lens.project(rays - _STEP * across)
    after, valid = lens.project(rays + _STEP * across)
    good = good & valid & (sine > _LEAST_SINE)
    along = np.where(good[:, None], after - before, [0.0, -1.0])
    return along / np.maximum(np.linalg.norm(along, axis=1), 1e-12)[:, None], good
