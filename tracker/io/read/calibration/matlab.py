"""MATLAB ``.mat``: ``toStruct(stereoParams)``, Bouguet's toolbox, and structs with K, R, t.

MATLAB counts pixels from 1 and, in the fields of its older releases, multiplies from the
right, so that matrices are transposed; world units are those of the board.

Source: MathWorks, ``stereoParameters``, ``cameraIntrinsics``, ``toStruct``; Bouguet, "Camera
Calibration Toolbox for MATLAB", which counts pixels from 0.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator
from typing import Any

import numpy as np

from tracker.files.text import shown
from tracker.io.read.calibration.camera_fields import cameras, has_cameras
from tracker.io.read.pieces import CalibrationPiece, Convention, Piece, RawCamera, Unit
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import SourceFile
from tracker.io.read.values import intrinsics, lens, matrix, numbers, rotation, vector

NAME = "MATLAB .mat of cameras"
KIND: Kind = "calibration"
SERIES = False

MOST_BYTES = 16 * 2**20
MOST_UNPACKED_BYTES = 64 * 2**20

_UNITS: dict[str, Unit] = {
    "mm": "mm", "millimeters": "mm", "cm": "cm", "centimeters": "cm", "m": "m", "meters": "m",
}  # fmt: skip


def recognise(file: SourceFile) -> Certainty:
    """The first words of a MATLAB file."""
    return Certainty.SURE if file.head.startswith(b"MATLAB ") else Certainty.NO


def read(file: SourceFile) -> Iterator[Piece]:
    """One piece with every camera."""
    values = _load(file)
    stereo = _find(values, "CameraParameters1")
    if stereo is not None:
        found = tuple(_stereo(file, stereo))
    elif "fc_left" in values and "fc_right" in values:
        found = tuple(_bouguet(file, values))
    elif has_cameras(values):
        found = tuple(cameras(file, values, Convention()))
    else:
        raise file.error(
            f"expected toStruct(stereoParams), or structs with K, R and t, found the variables "
            f"{shown(', '.join(values))}"
        )
    yield CalibrationPiece(file.path, NAME, found)


def _load(file: SourceFile) -> dict[str, Any]:
    import scipy.io  # a server starts without it

    data = file.bytes(MOST_BYTES)
    if data.startswith(b"MATLAB 7.3"):
        raise file.error('is of version 7.3 (HDF5), expected 7 or older; save it with "-v7"')
    try:
        _check_size(file, data)
        stream: Any = io.BytesIO(data)
        values = scipy.io.loadmat(stream, simplify_cells=True)
    except (ValueError, TypeError, KeyError, IndexError, EOFError, OverflowError,
            MemoryError, NotImplementedError, zlib.error, struct.error) as error:  # fmt: skip
        raise file.error(f"cannot be read as a MATLAB file ({error}); save it again") from None
    values = {k: v for k, v in values.items() if not k.startswith("__")}
    if any(type(v).__name__ == "MatlabOpaque" for v in values.values()) or not values:
        raise file.error(
            "holds MATLAB objects, which only MATLAB reads; save toStruct(stereoParams) instead"
        )
    return values


def _check_size(file: SourceFile, data: bytes) -> None:
    """Unpack every variable once, at most so many bytes: a few may stand for gigabytes."""
    order = "<" if data[126:128] == b"IM" else ">"
    place, total = 128, 0
    while place + 8 <= len(data):
        kind, size = struct.unpack(f"{order}II", data[place : place + 8])
        if kind == 15:  # miCOMPRESSED
            unpacker = zlib.decompressobj()
            left = MOST_UNPACKED_BYTES - total
            total += len(unpacker.decompress(data[place + 8 : place + 8 + size], left))
            if unpacker.unconsumed_tail or total >= MOST_UNPACKED_BYTES:
                raise file.error(
                    f"unpacks to more than {MOST_UNPACKED_BYTES / 2**20:.0f} MB, "
                    "expected a calibration"
                )
        place += 8 + size


def _find(values: Any, name: str, depth: int = 0) -> dict[str, Any] | None:
    """The first struct that has a field of this name."""
    if not isinstance(values, dict) or depth > 3:
        return None
    if name in values:
        return values
    found = (_find(value, name, depth + 1) for value in values.values())
    return next((value for value in found if value is not None), None)


def _stereo(file: SourceFile, values: dict[str, Any]) -> Iterator[RawCamera]:
    """The world is camera 1; x₂ = x₁ R + t in rows, so R is transposed, t in WorldUnits."""
    first = values["CameraParameters1"]
    unit = _UNITS.get(str(values.get("WorldUnits") or first.get("WorldUnits", "")).lower())
    convention = Convention(unit=unit, direction="world-to-camera", axes="opencv")
    pose = values.get("PoseCamera2")
    if isinstance(pose, dict):
        turned = rotation(file, "PoseCamera2.R", pose["R"])
        moved = vector(file, "PoseCamera2.Translation", pose["Translation"], 3, "x y z")
    else:
        both = [values.get("RotationOfCamera2"), values.get("TranslationOfCamera2")]
        if any(part is None for part in both):
            raise file.error("RotationOfCamera2 or TranslationOfCamera2 is missing")
        turned = rotation(file, "RotationOfCamera2", both[0]).T
        moved = vector(file, "TranslationOfCamera2", both[1], 3, "x y z")
    poses = ((np.eye(3), np.zeros(3)), (turned, moved))
    for side, (rotated, translation) in zip("12", poses, strict=True):
        field = f"CameraParameters{side}"
        fields = values[field]
        if "K" in fields:
            k = matrix(file, f"{field}.K", fields["K"], 3, 3)
        else:
            k = matrix(file, f"{field}.IntrinsicMatrix", fields["IntrinsicMatrix"], 3, 3).T
        k = intrinsics(file, f"{field}.K", k) - [[0, 0, 1], [0, 0, 1], [0, 0, 0]]
        radial = numbers(file, f"{field}.RadialDistortion", fields["RadialDistortion"])
        tangential = numbers(file, f"{field}.TangentialDistortion", fields["TangentialDistortion"])
        distortion, model = lens(file, field, [*radial[:2], *tangential, *radial[2:]])
        size = fields.get("ImageSize")
        height_width = numbers(file, f"{field}.ImageSize", [] if size is None else size)
        yield RawCamera(
            name=side,
            image_size=(int(height_width[1]), int(height_width[0]))
            if len(height_width) == 2
            else None,
            intrinsics=k,
            distortion=distortion,
            lens=model,
            rotation=rotated,
            translation=translation,
            convention=convention,
        )


def _bouguet(file: SourceFile, values: dict[str, Any]) -> Iterator[RawCamera]:
    """x_right = R x_left + T, millimetres by its tutorial, but in fact the board's unit."""
    convention = Convention(direction="world-to-camera", axes="opencv")
    right = (values.get("R", values.get("om")), values.get("T"))
    for side, (turned, translation) in {"left": (np.eye(3), np.zeros(3)), "right": right}.items():
        fx, fy = vector(file, f"fc_{side}", values[f"fc_{side}"], 2, "focal lengths")
        cx, cy = vector(file, f"cc_{side}", values.get(f"cc_{side}"), 2, "principal point")
        skew = float(values.get(f"alpha_c_{side}", 0.0))
        distortion, model = lens(file, f"kc_{side}", values.get(f"kc_{side}"))
        size = (values.get("nx"), values.get("ny"))
        yield RawCamera(
            name=side,
            image_size=None if None in size else (int(size[0]), int(size[1])),  # type: ignore[arg-type]
            intrinsics=np.array([[fx, skew * fx, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]),
            distortion=distortion,
            lens=model,
            rotation=rotation(file, "R", turned),
            translation=vector(file, "T", translation, 3, "x y z"),
            convention=convention,
        )
