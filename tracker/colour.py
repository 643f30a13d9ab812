"""What a target looks like: colour histograms of boxes and their distance to templates.

Boxes are ``centre_x, centre_y, half_width, half_height`` in pixels.

[ZW21] Zhu, Wang, "3D target position tracking based on probability hypothesis
density filtering", 2021, §2.1.
[CRM03] Comaniciu, Ramesh, Meer, "Kernel-based object tracking", IEEE TPAMI 25(5), 2003.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

import cv2
import numpy as np
from jaxtyping import Float, Int, UInt8, UInt16
from numpy import ndarray

from tracker import image_kernels

ColourSpaceName = Literal["hue_saturation", "rgb"]
KernelName = Literal["epanechnikov", "flat"]

BINS: dict[str, int] = {"hue_saturation": 16 * 16 + 16, "rgb": 8 * 8 * 8}
"""Bins of each histogram space."""

LEAST_SATURATION, LEAST_VALUE = 40, 40
"""Of 255: below either, a pixel's hue is mostly noise, and its value is counted instead."""

LONGEST_SIDE = 24
"""Boxes wider or taller than this many pixels are read with a stride: enough for a histogram."""


def bin_map(picture: UInt8[ndarray, "h w 3"], space: ColourSpaceName) -> UInt16[ndarray, "h w"]:
    """The histogram bin of each pixel of a BGR picture.

    ``rgb`` cuts each channel into 8 (512 bins). ``hue_saturation`` takes 16 hues
    × 16 saturations where the pixel is coloured and 16 values where it is not
    (272 bins), so that brightness counts only where there is no colour.

    Raises:
        ValueError: If there is no such space.
    """
    if space == "rgb":
        eighths: ndarray = (picture >> 5).astype(np.uint16)
        bins: ndarray = eighths[..., 2] << 6 | eighths[..., 1] << 3 | eighths[..., 0]
        return bins
    if space == "hue_saturation":
        hsv = cv2.cvtColor(picture, cv2.COLOR_BGR2HSV)
        bins = image_kernels.hue_saturation_bins(hsv, LEAST_SATURATION, LEAST_VALUE)
        return bins
    raise ValueError(
        f"colour space: expected one of {', '.join(get_args(ColourSpaceName))}, got {space!r}"
    )


def distance(
    first: Float[ndarray, "*N bins"], second: Float[ndarray, "*N bins"]
) -> Float[ndarray, "*N"]:
    """Bhattacharyya distance sqrt(1 - Σ_u sqrt(p(u) q(u))): 0 for equal, 1 for disjoint ones."""
    coefficient = np.sqrt(first * second).sum(axis=-1)
    return np.asarray(np.sqrt(np.clip(1.0 - coefficient, 0.0, 1.0)))


def likelihood(distances: Float[ndarray, " N"], sigma: float) -> Float[ndarray, " N"]:
    """l_z = N(D; 0, σ²), the colour likelihood of [ZW21]."""
    return np.exp(-0.5 * (distances / sigma) ** 2) / (sigma * math.sqrt(2.0 * math.pi))


@dataclass(frozen=True, slots=True, eq=False)
class ColourModel:
    """Templates in one histogram space, and how boxes are compared with them."""

    space: ColourSpaceName
    kernel: KernelName
    templates: Float[ndarray, "n bins"]
    """Histograms q_1 … q_n, each summing to 1."""
    roots: Float[ndarray, "n bins"]
    """Their square roots."""

    @staticmethod
    def of(
        templates: Float[ndarray, "n bins"], space: ColourSpaceName, kernel: KernelName
    ) -> ColourModel:
        """A model of given histograms.

        Raises:
            ValueError: If there is no template, or one has another number of bins.
        """
        if len(templates) == 0:
            raise ValueError("a colour model needs at least one template, got none")
        if templates.shape[1] != BINS[space]:
            raise ValueError(
                f"templates of space {space} have {BINS[space]} bins, got {templates.shape[1]}"
            )
        return ColourModel(space, kernel, templates, np.sqrt(templates))

    def distances(
        self, bins: UInt16[ndarray, "h w"], boxes: Float[ndarray, "N 4"]
    ) -> tuple[Float[ndarray, " N"], Int[ndarray, " N"]]:
        """D = min_i sqrt(1 - Σ_u sqrt(p(u) q_i(u))) of each box, and the template i it is for.

        Args:
            bins: :func:`bin_map` of the picture, computed once a picture.
            boxes: Pixels. Where a box lies partly outside, what is inside counts;
                wholly outside, D is 1.
        """
        boxes = np.ascontiguousarray(boxes, dtype=float)
        nearest: tuple[ndarray, ndarray] = image_kernels.nearest_templates(
            bins, boxes, self.roots, self.kernel == "epanechnikov", LONGEST_SIDE
        )
        return nearest


def histograms(
    bins: UInt16[ndarray, "h w"],
    boxes: Float[ndarray, "N 4"],
    space: ColourSpaceName,
    kernel: KernelName,
) -> Float[ndarray, "N bins"]:
    """The colour histogram of each box, summing to 1; all 0 where a box holds no pixel.

    With the Epanechnikov kernel a pixel weighs 1 - r², r being 1 on the ellipse
    inscribed in the box ([CRM03]): the middle counts, the corners do not.
    """
    boxes = np.ascontiguousarray(boxes, dtype=float)
    result: ndarray = image_kernels.box_histograms(
        bins, boxes, BINS[space], kernel == "epanechnikov", LONGEST_SIDE
    )
    return result
