"""The result of a segmentation, and the interface of foreground models."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from jaxtyping import Float, UInt8
from numpy import ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Segmentation:
    """The segmentation of one image."""

    mask: UInt8[ndarray, "h w"]
    """1 on the foreground, 0 elsewhere."""
    thresholds: Float[ndarray, " 3"]
    """The thresholds in blue, green and red, in the model's own units."""


class ForegroundModel(Protocol):
    """A background model that segments images; a state goes from image to image."""

    def start(self) -> Any:
        """The state before the first image."""
        ...

    def step(self, state: Any, picture: UInt8[ndarray, "h w 3"]) -> tuple[Any, Segmentation]:
        """Segment the next image.

        Args:
            state: The state after the image before.
            picture: The image, BGR, of the background's size.
        """
        ...


def pack(mask: UInt8[ndarray, "h w"]) -> UInt8[ndarray, " bytes"]:
    """Pack a mask into a few hundred bytes: its size, then its bits, compressed."""
    height, width = mask.shape
    size = np.array([height, width], dtype="<u4").tobytes()
    return np.frombuffer(size + zlib.compress(np.packbits(mask).tobytes(), 1), dtype=np.uint8)


def unpack(packed: UInt8[ndarray, " bytes"]) -> UInt8[ndarray, "h w"]:
    """Unpack a mask of :func:`pack`.

    Raises:
        ValueError: If the bytes are no packed mask.
    """
    try:
        height, width = np.frombuffer(packed[:8].tobytes(), dtype="<u4").tolist()
        bits = np.frombuffer(zlib.decompress(packed[8:].tobytes()), dtype=np.uint8)
        return np.unpackbits(bits, count=height * width).reshape(height, width)
    except (ValueError, zlib.error) as error:
        raise ValueError(f"expected a packed mask, got {packed.size} bytes: {error}") from None
