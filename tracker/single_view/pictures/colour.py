"""What a target looks like: colour histograms of boxes and their distance to templates.

Boxes are ``centre_x, centre_y, half_width, half_height`` in pixels.

[ZW21] Zhu, Wang, "3D target position tracking based on probability hypothesis
density filtering", 2021, §2.1.
[CRM03] Comaniciu, Ramesh, Meer, "Kernel-based object tracking", IEEE TPAMI 25(5), 2003.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import cv2
import numpy as np
from jaxtyping import Float, Int, UInt8, UInt16
from numpy import ndarray

from tracker.kernels.pictures import images

ColourSpaceName = Literal["hue_saturation", "rgb", "hsi"]
KernelName = Literal["epanechnikov", "flat"]

BINS: dict[str, int] = {"hue_saturation": 16 * 16 + 16, "rgb": 8 * 8 * 8, "hsi": 16 * 4 * 4 + 8}
"""Bins of each histogram space."""

LEAST_SATURATION, LEAST_VALUE = 40, 40
"""Of 255: below either, a pixel's hue is mostly noise, and its value is counted instead."""

LONGEST_SIDE = 24
"""Boxes wider or taller than this many pixels are read with a stride: enough for a histogram."""


def bin_map(picture: UInt8[ndarray, "h w 3"], space: ColourSpaceName) -> UInt16[ndarray, "h w"]:
    """The histogram bin of each pixel of a BGR picture.

    ``rgb`` cuts each channel into 8 (512 bins). ``hue_saturation`` takes 16 hues
    × 16 saturations where the pixel is coloured and 16 values where it is not
    (272 bins), so that brightness counts only where there is no colour. ``hsi``
    takes 16 hues × 4 saturations × 4 intensities where it is coloured and 8
    intensities where it is not (264 bins), of the five upper bits of each level 0 … 255:

        I = (R + G + B) / 3,  S = 1 - min(R, G, B) / I,
        cos H = (2R - G - B) / (2 sqrt((R - G)² + (R - B)(G - B)))

    (Gonzalez, Woods, *Digital Image Processing*, §6.2). A pixel is coloured where saturation and
    value reach :data:`LEAST_SATURATION` and :data:`LEAST_VALUE`.

    Args:
        picture: BGR, 0 … 255.
        space: Which bins.

    Raises:
        ValueError: If there is no such space.
    """
    if space == "rgb":
        eighths: ndarray = (picture >> 5).astype(np.uint16)
        bins: ndarray = eighths[..., 2] << 6 | eighths[..., 1] << 3 | eighths[..., 0]
        return bins
    if space == "hue_saturation":
        hsv = cv2.cvtColor(picture, cv2.COLOR_BGR2HSV)
        bins = images.hue_saturation_bins(hsv, LEAST_SATURATION, LEAST_VALUE)
        return bins
    if space == "hsi":
        fives: ndarray = (picture >> 3).astype(np.uint16)
        looked_up: ndarray = _HSI_BINS[fives[..., 0] << 10 | fives[..., 1] << 5 | fives[..., 2]]
        return looked_up
    raise ValueError(
        f"colour space: expected one of {', '.join(get_args(ColourSpaceName))}, got {space!r}"
    )


def _hsi_bins() -> UInt16[ndarray, " 32768"]:
    """The bin of every colour of five bits a channel, blue first."""
    levels = np.arange(32) * 8.0 + 3.5
    blue, green, red = np.meshgrid(levels, levels, levels, indexing="ij")
    intensity = (red + green + blue) / 3.0
    least = np.minimum(np.minimum(red, green), blue)
    saturation = 1.0 - least / intensity
    root = np.sqrt((red - green) ** 2 + (red - blue) * (green - blue))
    cosine = np.divide(2.0 * red - green - blue, 2.0 * root, out=np.ones_like(red), where=root > 0)
    angle = np.arccos(np.clip(cosine, -1.0, 1.0))
    hue = np.where(blue <= green, angle, 2.0 * np.pi - angle) / (2.0 * np.pi)
    cut = np.minimum(
        np.floor([hue * 16, saturation * 4, intensity / 64]), [[[[15]]], [[[3]]], [[[3]]]]
    )
    coloured = cut[0] * 16 + cut[1] * 4 + cut[2]
    grey = 256 + np.floor(intensity / 32)
    # the hue of what is pale or dark is mostly noise
    has_hue = (saturation * 255 >= LEAST_SATURATION) & (intensity >= LEAST_VALUE)
    return np.asarray(np.where(has_hue, coloured, grey).reshape(-1), dtype=np.uint16)


_HSI_BINS = _hsi_bins()


def distance(
    first: Float[ndarray, "*N bins"], second: Float[ndarray, "*N bins"]
) -> Float[ndarray, "*N"]:
    """Bhattacharyya distance sqrt(1 - Σ_u sqrt(p(u) q(u))) of histograms, as in [CRM03].

    Args:
        first: Histograms p, each summing to 1; any number of leading axes.
        second: Histograms q.

    Returns:
        0 for equal histograms, 1 for disjoint ones or where one is empty.
    """
    coefficient = np.sqrt(first * second).sum(axis=-1)
    return np.asarray(np.sqrt(np.clip(1.0 - coefficient, 0.0, 1.0)))


def likelihood(distances: Float[ndarray, " N"], sigma: float) -> Float[ndarray, " N"]:
    """l_z = N(D; 0, σ²), the colour likelihood of [ZW21] §2.1.

    Args:
        distances: Bhattacharyya distances D, 0 … 1.
        sigma: σ > 0, in units of D.
    """
    return np.exp(-0.5 * (distances / sigma) ** 2) / (sigma * math.sqrt(2.0 * math.pi))


@dataclass(frozen=True, slots=True, eq=False)
class ColourModel:
    """Templates in one histogram space, and how boxes are compared with them."""

    space: ColourSpaceName
    kernel: KernelName
    names: tuple[str, ...]
    """Whose templates they are, each person once."""
    roots: Float[ndarray, "n bins"]
    """Square roots of the histograms q_1 … q_n."""
    owners: Int[ndarray, " n"]
    """Index into ``names`` of each."""

    @staticmethod
    def of(
        templates: Float[ndarray, "n bins"],
        names: Sequence[str],
        space: ColourSpaceName,
        kernel: KernelName,
    ) -> ColourModel:
        """A model of given histograms.

        Args:
            templates: Histograms, each summing to 1.
            names: Whose each is; several may be of one person.
            space: The histograms' bins.
            kernel: How the pixels of a box are to count.

        Raises:
            ValueError: If there is no template, or they have another number of bins.
        """
        if len(templates) == 0:
            raise ValueError("a colour model needs at least one template, got none")
        if templates.shape != (len(names), BINS[space]):
            raise ValueError(
                f"{len(names)} templates of {BINS[space]} bins ({space}) must have shape "
                f"({len(names)}, {BINS[space]}), got {templates.shape}"
            )
        people = tuple(dict.fromkeys(names))
        owners = np.array([people.index(name) for name in names])
        return ColourModel(space, kernel, people, np.sqrt(templates), owners)

    def distances(
        self, bins: UInt16[ndarray, "h w"], boxes: Float[ndarray, "N 4"]
    ) -> Float[ndarray, "N G"]:
        """D = min_i sqrt(1 - Σ_u sqrt(p(u) q_i(u))) over the templates of each of G people.

        The distance of [ZW21], over all templates, is the smallest of a row.

        Args:
            bins: :func:`bin_map` of the picture, computed once a picture.
            boxes: Pixels. Where a box lies partly outside, what is inside counts;
                wholly outside, D is 1.
        """
        boxes = np.ascontiguousarray(boxes, dtype=float)
        nearest: ndarray = images.template_distances(
            bins, boxes, self.roots, self.owners, self.kernel == "epanechnikov", LONGEST_SIDE
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

    Args:
        bins: :func:`bin_map` of the picture.
        boxes: Pixels; what lies outside the picture does not count.
        space: Of ``bins``.
        kernel: The weight of a pixel by its place in the box.
    """
    boxes = np.ascontiguousarray(boxes, dtype=float)
    result: ndarray = images.box_histograms(
        bins, boxes, BINS[space], kernel == "epanechnikov", LONGEST_SIDE
    )
    return result
