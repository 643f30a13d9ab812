"""A Motion-JPEG video in an AVI file, from pictures that are already compressed.

OpenCV's own writers take no usable quality for Motion-JPEG, and compress in the
thread that writes; here the threads that draw also compress.
"""

from __future__ import annotations

import struct
from pathlib import Path
from types import TracebackType

import cv2
from numpy import ndarray

_HAS_INDEX, _KEY_FRAME = 0x10, 0x10


def compress(picture: ndarray, quality: int) -> bytes:
    """A picture (blue-green-red, 8 bit) as JPEG with halved colour resolution.

    Raises:
        OSError: If OpenCV cannot compress it.
    """
    done, data = cv2.imencode(
        ".jpg",
        picture,
        [
            cv2.IMWRITE_JPEG_QUALITY,
            quality,
            cv2.IMWRITE_JPEG_SAMPLING_FACTOR,
            cv2.IMWRITE_JPEG_SAMPLING_FACTOR_420,
        ],
    )
    if not done:
        raise OSError("OpenCV cannot compress pictures as JPEG here")
    return bytes(data)


def _chunk(name: bytes, data: bytes) -> bytes:
    return name + struct.pack("<I", len(data)) + data + b"\0" * (len(data) % 2)


def _list(kind: bytes, *chunks: bytes) -> bytes:
    return _chunk(b"LIST", kind + b"".join(chunks))


class AviWriter:
    """Writes one video; use it in a ``with`` statement, so that the headers are completed."""

    def __init__(self, path: Path, size: tuple[int, int], fps: float) -> None:
        self._size = size
        self._fps = fps
        self._index: list[tuple[int, int]] = []
        self._end = 4  # of the list of pictures, from its name on
        self._file = path.open("wb")
        self._file.write(self._headers())

    def __enter__(self) -> AviWriter:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            if kind is None:
                self._finish()
        finally:
            self._file.close()

    def write(self, picture: bytes) -> None:
        """Append one compressed picture."""
        chunk = _chunk(b"00dc", picture)
        self._index.append((self._end, len(picture)))
        self._end += len(chunk)
        self._file.write(chunk)

    def _finish(self) -> None:
        entries = [
            b"00dc" + struct.pack("<III", _KEY_FRAME, start, size) for start, size in self._index
        ]
        self._file.write(_chunk(b"idx1", b"".join(entries)))
        self._file.seek(0)
        self._file.write(self._headers())

    def _headers(self) -> bytes:
        """Everything before the first picture, for the pictures written so far."""
        width, height = self._size
        count = len(self._index)
        largest = max((size for _, size in self._index), default=0)
        rate = round(self._fps * 1000.0)
        main = struct.pack(
            "<14I",
            round(1e6 / self._fps),
            round(largest * self._fps),
            0,
            _HAS_INDEX,
            count,
            0,
            1,
            largest,
            width,
            height,
            *(0,) * 4,
        )
        stream = b"vidsMJPG" + struct.pack(
            "<IHHIIIIIIiI4H", 0, 0, 0, 0, 1000, rate, 0, count, largest, -1, 0, 0, 0, width, height
        )
        picture = struct.pack(
            "<IiiHH4sIiiII", 40, width, height, 1, 24, b"MJPG", 3 * width * height, 0, 0, 0, 0
        )
        header = _list(
            b"hdrl",
            _chunk(b"avih", main),
            _list(b"strl", _chunk(b"strh", stream), _chunk(b"strf", picture)),
        )
        index = 8 + 16 * count if count else 0
        body = len(header) + 8 + self._end + index
        return (
            b"RIFF"
            + struct.pack("<I", 4 + body)
            + b"AVI "
            + header
            + b"LIST"
            + struct.pack("<I", self._end)
            + b"movi"
        )
