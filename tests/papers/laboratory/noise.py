"""Pictures with noise added as they are decoded, the same for the same seed."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np
from jaxtyping import UInt8
from numpy import ndarray

from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Sequence

MARGIN = 256
"""Rows and columns of noise beyond a picture's: each picture is given another piece of it."""


class NoisyReader(FrameReader):
    """The pictures of a sequence, each with noise of its own.

    A field of normal noise is drawn once; every picture is given a piece of it, cut
    at a random place and turned at random, which is far cheaper than drawing it anew.
    """

    def __init__(self, sequence: Sequence, *, sigma: float, seed: int) -> None:
        """Draw the noise.

        Args:
            sequence: Whose pictures.
            sigma: Standard deviation in grey levels of 0 … 255, each channel by itself.
            seed: Of the noise.
        """
        super().__init__(sequence, cache_bytes=0)
        self._seed = seed
        widths, heights = zip(*(camera.image_size for camera in sequence.cameras), strict=True)
        shape = (max(heights) + MARGIN, max(widths) + MARGIN, 3)
        field = np.random.default_rng(seed).normal(0.0, sigma, shape)
        self._field = np.rint(field).astype(np.int16)

    def picture(self, camera: int, step: int) -> UInt8[ndarray, "h w 3"] | None:
        """As that of the reader, with noise."""
        return self._noisy(super().picture(camera, step), camera, step)

    def iterate(self, camera: int, first: int = 0) -> Iterator[UInt8[ndarray, "h w 3"] | None]:
        """As that of the reader, with the same noise as :meth:`picture`."""
        for step, picture in enumerate(super().iterate(camera, first), first):
            yield self._noisy(picture, camera, step)

    def _noisy(
        self, picture: UInt8[ndarray, "h w 3"] | None, camera: int, step: int
    ) -> UInt8[ndarray, "h w 3"] | None:
        if picture is None:
            return None
        rng = np.random.default_rng((self._seed, camera, step))
        height, width = picture.shape[:2]
        top = int(rng.integers(self._field.shape[0] - height + 1))
        left = int(rng.integers(self._field.shape[1] - width + 1))
        piece = self._field[top : top + height, left : left + width]
        turned = piece[:: rng.choice([-1, 1]), :: rng.choice([-1, 1])]
        # saturates at 0 and 255
        return np.asarray(cv2.add(picture, turned, dtype=cv2.CV_8U), dtype=np.uint8)
