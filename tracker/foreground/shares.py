"""How much of a rectangle is foreground: many rectangles at once, from sums made once a mask."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Float, Int, UInt8
from numpy import ndarray

from tracker import image_kernels


def integral(mask: UInt8[ndarray, "h w"]) -> Int[ndarray, "h1 w1"]:
    """Sums above and to the left of each corner, for :func:`box_shares`."""
    sums: ndarray = cv2.integral(mask)
    return sums


def box_shares(sums: Int[ndarray, "h1 w1"], edges: Float[ndarray, "N 4"]) -> Float[ndarray, " N"]:
    """The share of foreground in rectangles given by left, top, right, bottom.

    Of a rectangle partly outside the picture only what is inside counts; wholly
    outside the share is 0.
    """
    shares: ndarray = image_kernels.box_means(sums, np.ascontiguousarray(edges, dtype=float))
    return shares
