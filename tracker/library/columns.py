"""The encoding of a run's tracks: columns are delta-encoded, byte-shuffled and compressed by zlib.

Rows are sorted by track and then step, so that neighbours differ little; each number is replaced
by its difference from the previous one (delta encoding), and the bytes of all differences are
grouped by significance (byte shuffling). zlib's checksum detects damage. Positions are exact;
existence probabilities, standard deviations and heights are rounded to float32, detection
probabilities and the correlation of x and y to a thousandth. Earlier versions stored no
correlation, which is 0 there, and no heights, which are NaN.
"""

from __future__ import annotations

import io
import struct
import zlib
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Shaped
from numpy import ndarray

from tracker.fusion.trajectories import Trajectories

_MAGIC, _WITHOUT_HEIGHTS, _WITHOUT_COVARIANCES = b"MVT3", b"MVT2", b"MVT1"
"""The first bytes, which identify format and version, and those of the versions before."""

_HEAD = struct.Struct("<4sIH")
"""The header: :data:`_MAGIC`, the number of rows and the number of cameras."""

_LEVEL = 6
"""Compression level of zlib. It makes 177 kB of 500 steps of 10 people in 15 ms; level 1 makes
182 kB in 9 ms, level 9 makes 176 kB in 59 ms."""

_THOUSANDTHS = 1000.0
"""Detection probabilities and correlations are stored as multiples of one over this."""

_COLUMNS = (
    ("ids", 1, np.int32, np.int32), ("frames", 1, np.int32, np.int32),
    ("labels", 1, np.int64, np.int64), ("positions", 3, np.float64, np.int64),
    ("existences", 1, np.float32, np.int32), ("sigmas", 3, np.float32, np.int32),
)  # fmt: skip
"""The stored fields of the tracks: name, number of columns, type, and the integer type of the same
size whose differences are stored. The cameras' columns follow."""

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
    probabilities = np.rint(kept.detection_probabilities[order] * _THOUSANDTHS).astype(np.int16)
    parts = [
        _planes(np.ascontiguousarray(column, dtype=kind).view(integers))
        for name, _, kind, integers in _COLUMNS
        for column in np.atleast_2d(getattr(tracks, name)[order].T)
    ]
    parts += [np.packbits(column).tobytes() for column in tracks.seen[order].T]
    parts += [_planes(np.ascontiguousarray(column)) for column in probabilities.T]
    products = np.prod(tracks.sigmas[order, :2], axis=1)
    correlations = tracks.covariances_xy[order] / np.where(products > 0.0, products, 1.0)
    parts.append(_planes(np.rint(correlations * _THOUSANDTHS).astype(np.int16)))
    parts += [
        _planes(np.ascontiguousarray(column[order], dtype=np.float32).view(np.int32))
        for column in (tracks.heights, tracks.sigma_heights)
    ]
    return _HEAD.pack(_MAGIC, rows, cameras) + zlib.compress(b"".join(parts), _LEVEL)


def unpack(data: bytes) -> KeptTracks:
    """Decode the bytes of :func:`pack`; rows are sorted by step and then id.

    Raises:
        ValueError: If the bytes are damaged.
    """
    try:
        magic, rows, cameras = _HEAD.unpack_from(data)
        if magic not in (_MAGIC, _WITHOUT_HEIGHTS, _WITHOUT_COVARIANCES) or rows > _MOST_ROWS:
            raise ValueError("they do not begin as they should")
        raw = io.BytesIO(zlib.decompress(data[_HEAD.size :]))
        columns = {
            name: [_integers(raw, rows, integers).view(kind) for _ in range(count)]
            for name, count, kind, integers in _COLUMNS
        }
        seen = [_bits(raw, rows) for _ in range(cameras)]
        probabilities = [_integers(raw, rows, np.int16) for _ in range(cameras)]
        correlations = np.zeros(rows, dtype=np.int16)
        if magic != _WITHOUT_COVARIANCES:
            correlations = _integers(raw, rows, np.int16)
        heights = np.full((2, rows), np.nan)
        if magic == _MAGIC:
            heights[:] = [_integers(raw, rows, np.int32).view(np.float32) for _ in heights]
        if raw.read(1):
            raise ValueError("there are more of them than there should be")
    except (ValueError, struct.error, zlib.error) as error:
        raise ValueError(f"the tracks' bytes are damaged: {error}") from None
    order = np.lexsort((columns["ids"][0], columns["frames"][0]))
    (ids,), (frames,), (labels,), positions, (existences,), sigmas = columns.values()
    frames = frames[order].astype(np.int64)
    deviations = _beside(sigmas, rows, np.float64)[order]
    return KeptTracks(
        Trajectories(
            frames=frames,
            ids=ids[order].astype(np.int64),
            positions=_beside(positions, rows, np.float64)[order],
            existences=existences[order].astype(np.float64),
            sigmas=deviations,
            seen=_beside(seen, rows, np.bool_)[order],
            components=np.arange(rows) - np.searchsorted(frames, frames),
            labels=labels[order],
            covariances_xy=correlations[order] / _THOUSANDTHS * np.prod(deviations[:, :2], axis=1),
            heights=heights[0, order],
            sigma_heights=heights[1, order],
        ),
        _beside(probabilities, rows, np.int16)[order] / _THOUSANDTHS,
    )


def _beside(columns: list[ndarray], rows: int, kind: type[np.generic]) -> ndarray:
    """Return columns as an array, which has a number of rows even without columns."""
    return np.stack(columns, axis=1).astype(kind) if columns else np.zeros((rows, 0), dtype=kind)


def _planes(values: Shaped[ndarray, " N"]) -> bytes:
    """Return the differences of consecutive values, modulo 2 to the number of bits of their type,
    with their bytes grouped by significance."""
    difference = values.copy()
    difference[1:] = values[1:] - values[:-1]
    return difference.view(np.uint8).reshape(-1, values.itemsize).T.tobytes()


def _integers(raw: io.BytesIO, rows: int, kind: type[np.signedinteger]) -> Shaped[ndarray, " N"]:
    """Read the values of :func:`_planes`."""
    size = np.dtype(kind).itemsize
    planes = _bytes(raw, size * rows).reshape(size, rows)
    return np.cumsum(np.ascontiguousarray(planes.T).view(kind)[:, 0], dtype=kind)


def _bits(raw: io.BytesIO, rows: int) -> Bool[ndarray, " N"]:
    return np.unpackbits(_bytes(raw, -(-rows // 8)), count=rows).astype(bool)


def _bytes(raw: io.BytesIO, count: int) -> ndarray:
    found = np.frombuffer(raw.read(count), dtype=np.uint8)
    if len(found) < count:
        raise ValueError("some are missing")
    return found
