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
from tracker.io.read.calibration.camera_fields import camera, cameras, has_cameras
from tracker.io.read.pieces import CalibrationPiece, Convention, Piece, RawCamera, unit_named
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import SourceFile
from tracker.io.read.values import focal_and_centre, matrix, need, numbers, vector

NAME = "MATLAB .mat of cameras"
KIND: Kind = "calibration"
SERIES = False

_WORLD_TO_CAMERA = Convention(direction="world-to-camera", axes="opencv")

_FROM_1 = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]])
"""What the principal point loses where pixels are counted from 0."""

MOST_BYTES = 16 * 2**20
MOST_UNPACKED_BYTES = 64 * 2**20


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
    both = [values["CameraParameters1"], values["CameraParameters2"]]
    unit = unit_named(str(values.get("WorldUnits") or both[0].get("WorldUnits", "")))
    convention = Convention(unit=unit, direction="world-to-camera", axes="opencv")
    pose = values.get("PoseCamera2")
    if isinstance(pose, dict):
        turned, moved = pose["R"], pose["Translation"]
    else:
        need(file, values, ("RotationOfCamera2", "TranslationOfCamera2"))
        turned, moved = np.transpose(values["RotationOfCamera2"]), values["TranslationOfCamera2"]
    poses = ((np.eye(3), np.zeros(3)), (turned, moved))
    for side, own, (rotated, translation) in zip("12", both, poses, strict=True):
        k = own["K"] if "K" in own else np.transpose(own["IntrinsicMatrix"])
        size = numbers(file, f"CameraParameters{side}.ImageSize", own.get("ImageSize", []))
        fields = {
            "K": matrix(file, f"CameraParameters{side}.K", k, 3, 3) - _FROM_1,
            "radial": own["RadialDistortion"],
            "tangential": own["TangentialDistortion"],
            "R": rotated,
            "T": translation,
            **({"size": size[::-1]} if len(size) == 2 else {}),
        }
        yield camera(file, side, fields, convention)


def _bouguet(file: SourceFile, values: dict[str, Any]) -> Iterator[RawCamera]:
    """x_right = R x_left + T, millimetres by its tutorial, but in fact the board's unit."""
    poses = {"left": (np.eye(3), np.zeros(3)), "right": (values.get("R", values.get("om")),
                                                         values.get("T"))}  # fmt: skip
    size = {"size": [values["nx"], values["ny"]]} if {"nx", "ny"} <= values.keys() else {}
    for side, (turned, moved) in poses.items():
        fx, fy = vector(file, f"fc_{side}", values[f"fc_{side}"], 2, "focal lengths")
        cx, cy = vector(file, f"cc_{side}", values.get(f"cc_{side}"), 2, "principal point")
        k = focal_and_centre(fx, fy, cx, cy)
        k[0, 1] = fx * float(values.get(f"alpha_c_{side}", 0.0))
        fields = {"K": k, "D": values.get(f"kc_{side}"), "R": turned, "T": moved, **size}
        yield camera(file, side, fields, _WORLD_TO_CAMERA)
