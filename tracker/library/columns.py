"""The encoding of a run's tracks: columns are delta-encoded, byte-shuffled and compressed by zlib.

Rows are sorted by track and then step, so that neighbours differ little; each number is replaced
by its difference from the previous one (delta encoding), and the bytes of all differences are
grouped by significance (byte shuffling). zlib's checksum detects damage. Positions are exact;
existence probabilities and standard
deviations are rounded to float32, and detection probabilities to a thousandth.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Shaped
from numpy import ndarray

from tracker.fusion.trajectories import Trajectories

_MAGIC = b"MVT1"
"""The first bytes, which identify format and version."""

_HEAD = struct.Struct("<4sIH")
"""The header: :data:`_MAGIC`, the number of rows and the number of cameras."""

_LEVEL = 6
"""Compression level of zlib."""

_MOST_ROWS = 1 << 28
"""Largest number of rows that is read, so that a damaged header does not exhaust the memory."""


@dataclass(frozen=True, slots=True, eq=False)
class KeptTracks:
    """The part of a run's result that the library stores."""

    tracks: Trajectories
    """The N rows of the tracks."""
    detection_probabilities: Float[ndarray, "N C"]
    """The detection probability of each row in each of the C cameras."""


def pack(kept: KeptTracks) -> bytes:
    """Encode tracks as bytes."""
    tracks = kept.tracks
    order = np.lexsort((tracks.frames, tracks.ids))
    rows, cameras = len(tracks), tracks.seen.shape[1]
    probabilities = np.rint(kept.detection_probabilities[order] * 1000.0).astype(np.int16)
    parts = [
        _planes(tracks.ids[order].astype(np.int32)),
        _planes(tracks.frames[order].astype(np.int32)),
        _planes(tracks.labels[order].astype(np.int64)),
        *(_planes(column.view(np.int64)) for column in _apart(tracks.positions[order], np.float64)),
        _planes(tracks.existences[order].astype(np.float32).view(np.int32)),
        *(_planes(column.view(np.int32)) for column in _apart(tracks.sigmas[order], np.float32)),
        *(np.packbits(column).tobytes() for column in tracks.seen[order].T),
        *(_planes(np.ascontiguousarray(column)) for column in probabilities.T),
    ]
    return _HEAD.pack(_MAGIC, rows, cameras) + zlib.compress(b"".join(parts), _LEVEL)


def unpack(data: bytes) -> KeptTracks:
    """Decode the bytes of :func:`pack`; rows are sorted by step and then id.

    Raises:
        ValueError: If the bytes are damaged.
    """
    try:
        magic, rows, cameras = _HEAD.unpack_from(data)
        if magic != _MAGIC or rows > _MOST_ROWS:
            raise ValueError("they do not begin as they should")
        raw = zlib.decompress(data[_HEAD.size :])
        reader = _Reader(raw, rows)
        ids = reader.take(np.int32)
        frames = reader.take(np.int32)
        labels = reader.take(np.int64)
        positions = [reader.take(np.int64).view(np.float64) for _ in range(3)]
        existences = reader.take(np.int32).view(np.float32)
        sigmas = [reader.take(np.int32).view(np.float32) for _ in range(3)]
        seen = [reader.bits() for _ in range(cameras)]
        probabilities = [reader.take(np.int16) for _ in range(cameras)]
        reader.end()
    except (ValueError, struct.error, zlib.error) as error:
        raise ValueError(f"the tracks' bytes are damaged: {error}") from None
    order = np.lexsort((ids, frames))
    frames = frames[order].astype(np.int64)
    firsts = np.searchsorted(frames, frames)
    return KeptTracks(
        Trajectories(
            frames=frames,
            ids=ids[order].astype(np.int64),
            positions=_together(positions, order),
            existences=existences[order].astype(np.float64),
            sigmas=_together(sigmas, order),
            seen=_beside(seen, rows, bool)[order],
            components=np.arange(rows) - firsts,
            labels=labels[order],
        ),
        _beside(probabilities, rows, np.int16)[order] / 1000.0,
    )


def _apart(values: ndarray, kind: type[np.floating]) -> list[ndarray]:
    """Return the columns of an array, each contiguous and of one type."""
    return [np.ascontiguousarray(column, dtype=kind) for column in values.T]


def _together(columns: list[ndarray], order: ndarray) -> ndarray:
    """Return columns as an array of doubles, with the rows in an order."""
    together: ndarray = np.stack(columns, axis=1)[order].astype(np.float64)
    return together


def _beside(columns: list[ndarray], rows: int, kind: type) -> ndarray:
    """Return columns as an array, which has a number of rows even without columns."""
    return np.stack(columns, axis=1) if columns else np.zeros((rows, 0), dtype=kind)


def _planes(values: Shaped[ndarray, " N"]) -> bytes:
    """Return the differences of consecutive values, modulo 2 to the number of bits of their type,
    with their bytes grouped by significance."""
    difference = values.copy()
    difference[1:] = values[1:] - values[:-1]
    return difference.view(np.uint8).reshape(-1, values.itemsize).T.tobytes()


class _Reader:
    """A reader of one column after another from decompressed bytes."""

    def __init__(self, raw: bytes, rows: int) -> None:
        self._raw = raw
        self._rows = rows
        self._at = 0

    def take(self, kind: type[np.signedinteger]) -> ndarray:
        size = np.dtype(kind).itemsize
        planes = self._bytes(size * self._rows).reshape(size, self._rows)
        difference = np.ascontiguousarray(planes.T).view(kind)[:, 0]
        return np.cumsum(difference, dtype=kind)

    def bits(self) -> ndarray:
        return np.unpackbits(self._bytes(-(-self._rows // 8)), count=self._rows).astype(bool)

    def end(self) -> None:
        if self._at != len(self._raw):
            raise ValueError("there are more of them than there should be")

    def _bytes(self, count: int) -> ndarray:
        if self._at + count > len(self._raw):
            raise ValueError("some are missing")
        self._at += count
        return np.frombuffer(self._raw, dtype=np.uint8, count=count, offset=self._at - count)
