"""How much of a rectangle is foreground: many rectangles at once, from sums made once a mask."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Float, Int, UInt8
from numpy import ndarray

from tracker.kernels.pictures import images

# in half sizes from a box's centre, left, top, right, bottom: inside, above, left and right
_PARTS = np.array(
    [
        [-1.0, -1.0, 1.0, 1.0],
        [-1.0, -2.0, 1.0, -1.3],
        [-2.2, -1.0, -1.4, 0.3],
        [1.4, -1.0, 2.2, 0.3],
    ]
)


def integral(mask: UInt8[ndarray, "h w"]) -> Int[ndarray, "h1 w1"]:
    """The integral image: sums above and to the left of each pixel corner (h + 1, w + 1)."""
    sums: ndarray = cv2.integral(mask)
    return sums


def box_shares(sums: Int[ndarray, "h1 w1"], edges: Float[ndarray, "N 4"]) -> Float[ndarray, " N"]:
    """The share of foreground in rectangles given by left, top, right, bottom.

    Of a rectangle partly outside the picture only what is inside counts; wholly
    outside the share is 0.

    Args:
        sums: :func:`integral` of the mask.
        edges: Left, top, right, bottom, pixels, not rounded.
    """
    shares: ndarray = images.box_means(sums, np.ascontiguousarray(edges, dtype=float))
    return shares


def shape_shares(
    sums: Int[ndarray, "h1 w1"], boxes: Float[ndarray, "N 4"]
) -> tuple[Float[ndarray, " N"], Float[ndarray, " N"], Float[ndarray, " N"]]:
    """The shares of foreground inside boxes, above them, and beside their upper parts.

    Args:
        sums: :func:`integral` of the mask.
        boxes: Centre and half sizes, pixels.
    """
    middles, half_sizes = boxes[:, [0, 1, 0, 1]], boxes[:, [2, 3, 2, 3]]
    inside, above, left, right = (box_shares(sums, middles + part * half_sizes) for part in _PARTS)
    return inside, above, (left + right) / 2.0


def shape_scores(
    sums: Int[ndarray, "h1 w1"],
    boxes: Float[ndarray, "N 4"],
    *,
    inside_weight: float,
    around_weight: float,
) -> tuple[Float[ndarray, " N"], Float[ndarray, " N"]]:
    """What the foreground says of boxes: log factors of their likelihood, and shares inside.

    A box on a person is full of foreground, with background above and beside it:
    a ln(inside + 0.02) - b (above + beside), of :func:`shape_shares`.

    Args:
        sums: :func:`integral` of the mask.
        boxes: Centre and half sizes, pixels.
        inside_weight: a.
        around_weight: b.
    """
    inside, above, beside = shape_shares(sums, boxes)
    return inside_weight * np.log(inside + 0.02) - around_weight * (above + beside), inside
