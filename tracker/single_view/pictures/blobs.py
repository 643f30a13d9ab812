"""Connected components of a foreground mask, the detections of a camera without a detector.

Boxes are ``centre_x, centre_y, half_width, half_height`` in pixels, where the centre
of the first pixel is (0, 0): a component of one pixel has half sizes of one half.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, Int, UInt8
from numpy import ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Blobs:
    """The components of a mask that are large enough, by the top edges of their boxes."""

    boxes: Float[ndarray, "N 4"]
    """The bounding box of each component."""
    areas: Int[ndarray, " N"]
    """Number of pixels of each component."""
    owners: Int[ndarray, "h w"]
    """Component of each pixel, 0 … N - 1; -1 for the background and for small components."""

    @property
    def size(self) -> int:
        """The number of components."""
        return len(self.areas)


def blobs(mask: UInt8[ndarray, "h w"], minimum_area: int) -> Blobs:
    """Find the components of a mask, connected over sides and corners.

    Args:
        mask: The foreground mask, not 0 on the foreground.
        minimum_area: Number of pixels below which a component is dropped.

    Raises:
        ValueError: If ``mask`` is not an image of one channel.
    """
    if mask.ndim != 2:
        raise ValueError(f"mask: expected (height, width), got shape {mask.shape}")
    if mask.size == 0:
        return Blobs(np.zeros((0, 4)), np.zeros(0, np.int64), np.full(mask.shape, -1, np.int32))
    binary = np.ascontiguousarray(mask != 0).view(np.uint8)
    count, labels, statistics, _ = cv2.connectedComponentsWithStats(binary, connectivity=8)
    kept = 1 + np.flatnonzero(statistics[1:, cv2.CC_STAT_AREA] >= minimum_area)
    order = np.lexsort(statistics[kept][:, [cv2.CC_STAT_LEFT, cv2.CC_STAT_TOP]].T)
    kept = kept[order]
    new_name = np.full(count, -1, dtype=np.int32)
    new_name[kept] = np.arange(len(kept))
    left, top, width, height, areas = statistics[kept].astype(np.int64).T
    boxes = np.stack(
        [left + (width - 1) / 2.0, top + (height - 1) / 2.0, width / 2.0, height / 2.0]
    )
    return Blobs(np.ascontiguousarray(boxes.T), areas, new_name[labels])
