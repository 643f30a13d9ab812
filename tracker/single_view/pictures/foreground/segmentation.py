"""What every foreground model gives, and the interface by which they can be exchanged."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from jaxtyping import Float, UInt8
from numpy import ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Segmentation:
    """What of one picture is foreground."""

    mask: UInt8[ndarray, "h w"]
    """1 on the foreground, 0 elsewhere."""
    thresholds: Float[ndarray, " 3"]
    """What a pixel had to differ by in blue, green and red, in the model's own units."""


class ForegroundModel(Protocol):
    """A background and how pictures are compared with it; a state goes from picture to picture."""

    def start(self) -> Any:
        """The state before the first picture."""
        ...

    def step(self, state: Any, picture: UInt8[ndarray, "h w 3"]) -> tuple[Any, Segmentation]:
        """The foreground of the next picture, BGR."""
        ...


def pack(mask: UInt8[ndarray, "h w"]) -> UInt8[ndarray, " bytes"]:
    """A mask in a few hundred bytes: its size, then its bits, compressed."""
    height, width = mask.shape
    size = np.array([height, width], dtype="<u4").tobytes()
    return np.frombuffer(size + zlib.compress(np.packbits(mask).tobytes(), 1), dtype=np.uint8)


def unpack(packed: UInt8[ndarray, " bytes"]) -> UInt8[ndarray, "h w"]:
    """The mask that :func:`pack` was given.

    Raises:
        ValueError: If it is not one.
    """
    try:
        height, width = np.frombuffer(packed[:8].tobytes(), dtype="<u4").tolist()
        bits = np.frombuffer(zlib.decompress(packed[8:].tobytes()), dtype=np.uint8)
        return np.unpackbits(bits, count=height * width).reshape(height, width)
    except (ValueError, zlib.error) as error:
        raise ValueError(f"expected a packed mask, got {packed.size} bytes: {error}") from None
