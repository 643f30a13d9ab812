"""Colour appearance of targets: histograms of boxes and their distance to templates.

Boxes are ``centre_x, centre_y, half_width, half_height`` in pixels.

[ZW21] Zhu, Wang, "3D target position tracking based on probability hypothesis
density filtering", 2021, §2.1.
[CRM03] Comaniciu, Ramesh, Meer, "Kernel-based object tracking", IEEE TPAMI 25(5), 2003.
"""

from __future__ import annotations

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
"""Saturation and value of 255 below which a pixel's hue is mostly noise, and its value counts."""

LONGEST_SIDE = 24
"""Side in pixels above which a box is sampled with a stride: enough for a histogram."""


def bin_map(picture: UInt8[ndarray, "h w 3"], space: ColourSpaceName) -> UInt16[ndarray, "h w"]:
    """Compute the histogram bin of each pixel of a BGR image.

    ``rgb`` divides each channel into 8 (512 bins). ``hue_saturation`` has 16 hues
    × 16 saturations where the pixel is coloured and 16 values where it is not
    (272 bins), so that brightness has an effect only without colour. ``hsi``
    has 16 hues × 4 saturations × 4 intensities where it is coloured and 8
    intensities where it is not (264 bins), of the five upper bits of each level 0 … 255:

        I = (R + G + B) / 3,  S = 1 - min(R, G, B) / I,
        cos H = (2R - G - B) / (2 sqrt((R - G)² + (R - B)(G - B)))

    (Gonzalez, Woods, *Digital Image Processing*, §6.2). A pixel is coloured where saturation and
    value reach :data:`LEAST_SATURATION` and :data:`LEAST_VALUE`.

    Args:
        picture: The image, BGR, 0 … 255.
        space: The kind of bins.

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
    """The bin of every colour of five bits for each channel, blue first."""
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
    # the hue of a pale or dark pixel is mostly noise
    has_hue = (saturation * 255 >= LEAST_SATURATION) & (intensity >= LEAST_VALUE)
    return np.asarray(np.where(has_hue, coloured, grey).reshape(-1), dtype=np.uint16)


_HSI_BINS = _hsi_bins()


@dataclass(frozen=True, slots=True, eq=False)
class ColourModel:
    """Templates in one histogram space, for comparison with boxes."""

    space: ColourSpaceName
    """The kind of bins."""
    kernel: KernelName
    """The weights of the pixels of a box."""
    names: tuple[str, ...]
    """Names of the people with templates, each person once."""
    roots: Float[ndarray, "n bins"]
    """Square roots of the histograms q_1 … q_n."""
    owners: Int[ndarray, " n"]
    """Index into ``names`` of each histogram."""

    @staticmethod
    def of(
        templates: Float[ndarray, "n bins"],
        names: Sequence[str],
        space: ColourSpaceName,
        kernel: KernelName,
    ) -> ColourModel:
        """Make a model of given histograms.

        Args:
            templates: Histograms, each with sum 1.
            names: Name of the person of each; several may be of one person.
            space: The kind of bins.
            kernel: The weights of the pixels of a box.

        Raises:
            ValueError: If there is no template, or the number of bins is wrong.
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
        """Compute the Bhattacharyya distance of each box to each person's nearest template.

            D = min_i sqrt(1 - Σ_u sqrt(p(u) q_i(u)))

        over the templates of each of G people, with the histogram p of the box and q_i of a
        template ([CRM03]): 0 for equal histograms, 1 for disjoint ones. The distance of [ZW21],
        over all templates, is the smallest value of a row.

        Args:
            bins: :func:`bin_map` of the image.
            boxes: Centre and half sizes of N boxes, pixels. Of a box partly outside the image the
                part inside is used; wholly outside, D is 1.
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
    """Compute the colour histogram of each box, with sum 1; 0 for a box without pixels.

    With the Epanechnikov kernel a pixel has the weight 1 - r², r being 1 on the ellipse
    inscribed in the box ([CRM03]), so that the corners have none.

    Args:
        bins: :func:`bin_map` of the image.
        boxes: Centre and half sizes, pixels; the part outside the image is left out.
        space: The kind of ``bins``.
        kernel: The weight of a pixel by its place in the box.
    """
    boxes = np.ascontiguousarray(boxes, dtype=float)
    result: ndarray = images.box_histograms(
        bins, boxes, BINS[space], kernel == "epanechnikov", LONGEST_SIDE
    )
    return result
