"""COLMAP's binary model, as it writes it by default: ``images.bin``, ``cameras.bin`` beside it.

Little-endian; a count of records, then: of an image its number, quaternion w x y z, translation,
camera, name ended by a zero, and so many points of 24 bytes; of a camera its number, model, width,
height and the model's parameters.

Source: COLMAP, "Output format", "Binary file format".
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

from tracker.io.read.calibration.reconstruction.colmap import MOST_IMAGES, posed, read_lens
from tracker.io.read.pieces import CalibrationPiece, FormatError, Piece
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import SourceFile

NAME = "COLMAP binary model"
KIND: Kind = "calibration"
SERIES = False

MOST_BYTES = 64 * 2**20
"""A hundred pictures with a hundred thousand points each have 240 MB; ten thousand are usual."""

MODELS: dict[int, tuple[str, int]] = {
    0: ("SIMPLE_PINHOLE", 3), 1: ("PINHOLE", 4), 2: ("SIMPLE_RADIAL", 4), 3: ("RADIAL", 5),
    4: ("OPENCV", 8), 5: ("OPENCV_FISHEYE", 8), 6: ("FULL_OPENCV", 12), 7: ("FOV", 5),
    8: ("SIMPLE_RADIAL_FISHEYE", 4), 9: ("RADIAL_FISHEYE", 5), 10: ("THIN_PRISM_FISHEYE", 12),
}  # fmt: skip
"""Names and counts of parameters by number."""

_COUNT, _CAMERA = struct.Struct("<Q"), struct.Struct("<IIQQ")
_IMAGE, _POINT = struct.Struct("<I7dI"), 24
_LONGEST_NAME = 1024


def recognise(file: SourceFile) -> Certainty:
    """Bytes that are, from the first to the last, records of images or of cameras."""
    if file.is_text or not 64 <= file.size <= MOST_BYTES:
        return Certainty.NO
    begins = _begins_as_images(file.head) or _begins_as_cameras(file.head)
    return Certainty.LIKELY if begins else Certainty.NO


def read(file: SourceFile) -> Iterator[Piece]:
    """One piece with a camera an image, from the poses; the lenses are read with them."""
    if not _begins_as_images(file.head):
        if not any(_begins_as_images(file.member(path).head) for path in _beside(file)):
            raise file.error("has COLMAP's lenses, but images.bin with the poses is not beside it")
        return
    lenses = [path for path in _beside(file) if _begins_as_cameras(file.member(path).head)]
    if not lenses:
        raise file.error("has COLMAP's poses, but cameras.bin with the lenses is not beside it")
    try:
        cameras = file.member(lenses[0])
        by_id = {
            key: read_lens(cameras, key, model, size, parameters)
            for key, model, size, parameters in _cameras(cameras)
        }
        found = tuple(posed(file, name, values, key, by_id) for name, values, key in _images(file))
    except struct.error:
        raise file.error("ends within a record; it may be cut short: get the file again") from None
    if len(found) > MOST_IMAGES:
        raise file.error(
            f"has {len(found)} images, expected one image a camera that stands still, "
            f"at most {MOST_IMAGES}; export the model of one moment"
        )
    yield CalibrationPiece(file.path, NAME, found)


def _beside(file: SourceFile) -> list[Path]:
    return [p for p in sorted(file.path.parent.glob("*.bin")) if p != file.path]


def _begins_as_images(head: bytes) -> bool:
    """Whether the first record is an image: its quaternion has the length 1."""
    if len(head) < _COUNT.size + _IMAGE.size + 2:
        return False
    (count,) = _COUNT.unpack_from(head)
    _, *pose, _ = _IMAGE.unpack_from(head, _COUNT.size)
    end = head.find(b"\0", _COUNT.size + _IMAGE.size)
    name = head[_COUNT.size + _IMAGE.size : end]
    printed = 0 < len(name) < _LONGEST_NAME and min(name) >= 32
    return 0 < count < 2**32 and abs(sum(q * q for q in pose[:4]) - 1.0) < 1e-6 and printed


def _begins_as_cameras(head: bytes) -> bool:
    """Whether the first record is a camera of a known model and a size of pictures."""
    if len(head) < _COUNT.size + _CAMERA.size:
        return False
    (count,) = _COUNT.unpack_from(head)
    _, model, width, height = _CAMERA.unpack_from(head, _COUNT.size)
    return 0 < count < 2**32 and model in MODELS and 16 <= min(width, height) < 65536


def _cameras(file: SourceFile) -> Iterator[tuple[str, str, list[str], list[str]]]:
    data = file.bytes(MOST_BYTES)
    (count,) = _COUNT.unpack_from(data)
    place = _COUNT.size
    for _ in range(count):
        key, model, width, height = _CAMERA.unpack_from(data, place)
        place += _CAMERA.size
        if model not in MODELS:
            raise FormatError(f"{file.where}, camera {key}: has a lens of an unknown model {model}")
        name, parameters = MODELS[model]
        values = struct.unpack_from(f"<{parameters}d", data, place)
        place += 8 * parameters
        yield str(key), name, [str(width), str(height)], [repr(v) for v in values]


def _images(file: SourceFile) -> Iterator[tuple[str, list[str], str]]:
    data = file.bytes(MOST_BYTES)
    (count,) = _COUNT.unpack_from(data)
    place = _COUNT.size
    for _ in range(count):
        _, *pose, key = _IMAGE.unpack_from(data, place)
        place += _IMAGE.size
        end = data.find(b"\0", place, place + _LONGEST_NAME)
        if end < 0:
            raise struct.error
        (points,) = _COUNT.unpack_from(data, end + 1)
        name = data[place:end].decode("utf-8", errors="replace")
        place = end + 1 + _COUNT.size + _POINT * points
        yield name, [repr(value) for value in pose], str(key)
