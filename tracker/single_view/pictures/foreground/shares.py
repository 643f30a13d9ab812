"""Shares of foreground in rectangles, for many at once, from the integral image of a mask."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Float, Int, UInt8
from numpy import ndarray

from tracker.kernels.pictures import images

LEAST_SHARE = 0.02
"""ε, a share that is added before the logarithm: an empty box costs a ln ε = -3.9 a and not
infinity."""

# in half sizes from a box's centre, left, top, right, bottom: inside, above, left and right. Gaps
# of 0.3 and 0.4 leave out what stands out of a box that is too small for its own person: heights
# vary by a tenth, of which 0.3 is three deviations, and arms add to the width. Beside, the parts
# end at the chest, since hands stand out below. Chosen by these reasons, not by a measurement.
_PARTS = np.array(
    [
        [-1.0, -1.0, 1.0, 1.0],
        [-1.0, -2.0, 1.0, -1.3],
        [-2.2, -1.0, -1.4, 0.3],
        [1.4, -1.0, 2.2, 0.3],
    ]
)


def integral(mask: UInt8[ndarray, "h w"]) -> Int[ndarray, "h1 w1"]:
    """Compute the integral image: sums above and left of each pixel corner (h + 1, w + 1)."""
    sums: ndarray = cv2.integral(mask)
    return sums


def box_shares(sums: Int[ndarray, "h1 w1"], edges: Float[ndarray, "N 4"]) -> Float[ndarray, " N"]:
    """Compute the share of foreground in rectangles given by left, top, right, bottom.

    Of a rectangle partly outside the image only the part inside is used; wholly
    outside the share is 0.

    Args:
        sums: Integral image of the mask, of :func:`integral`.
        edges: Left, top, right, bottom, pixels, not rounded.
    """
    shares: ndarray = images.box_means(sums, np.ascontiguousarray(edges, dtype=float))
    return shares


def shape_shares(
    sums: Int[ndarray, "h1 w1"], boxes: Float[ndarray, "N 4"]
) -> tuple[Float[ndarray, " N"], Float[ndarray, " N"], Float[ndarray, " N"]]:
    """Compute the shares of foreground inside boxes, above them, and beside their upper parts.

    Args:
        sums: Integral image of the mask, of :func:`integral`.
        boxes: Centre and half sizes of N boxes, pixels.
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
    outline: float = 1.0,
) -> tuple[Float[ndarray, " N"], Float[ndarray, " N"]]:
    """Compute log factors of the likelihood of boxes from the foreground, and shares inside.

    A box on a person is full of foreground, with background above and beside it:
    a ln(inside + ε) - b (above + beside), of :func:`shape_shares`, with ε = 0.02. A box that
    is as full as the outline of a person counts as full.

    Args:
        sums: Integral image of the mask, of :func:`integral`.
        boxes: Centre and half sizes of N boxes, pixels.
        inside_weight: a, the weight of the share inside.
        around_weight: b, the weight of the shares around.
        outline: Share of a box that the outline of a person fills, 0 … 1.
    """
    inside, above, beside = shape_shares(sums, boxes)
    inside = np.minimum(inside / outline, 1.0)
    return inside_weight * np.log(inside + LEAST_SHARE) - around_weight * (above + beside), inside
