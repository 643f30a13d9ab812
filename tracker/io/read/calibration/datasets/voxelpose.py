"""The JSON in which VoxelPose and what follows it give Campus and Shelf: fx, fy, cx, cy, k, p.

A point is seen at R (x - T): T is the camera's place. k has k1 k2 k3, p has
p1 p2 of OpenCV's lens.

Source: Tu, Wang, Zeng, "VoxelPose", ECCV 2020, and its data sets.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from tracker.io.read.pieces import CalibrationPiece, Convention, Piece, RawCamera
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import SourceFile
from tracker.io.read.values import focal_and_centre, number, rotation, vector

NAME = "VoxelPose calibration JSON"
KIND: Kind = "calibration"
SERIES = False

_FIELDS = ("R", "T", "fx", "fy", "cx", "cy", "k", "p")
_CONVENTION = Convention(direction="world-to-camera", axes="opencv")


def recognise(file: SourceFile) -> Certainty:
    """JSON with a table a camera that has all of its fields."""
    head = file.head_text
    if head.lstrip()[:1] not in ("[", "{") or not all(f'"{name}"' in head for name in _FIELDS):
        return Certainty.NO
    return Certainty.SURE if _tables(file.json) else Certainty.NO


def read(file: SourceFile) -> Iterator[Piece]:
    """One piece with every camera."""
    cameras = tuple(_camera(file, name, fields) for name, fields in _tables(file.json).items())
    yield CalibrationPiece(file.path, NAME, cameras)


def _tables(values: Any) -> dict[str, dict[str, Any]]:
    rows = values.items() if isinstance(values, dict) else enumerate(values)
    return {
        str(name): fields
        for name, fields in rows
        if isinstance(fields, dict) and all(field in fields for field in _FIELDS)
    }


def _camera(file: SourceFile, name: str, fields: dict[str, Any]) -> RawCamera:
    fx, fy, cx, cy = (number(file, f"{name} {f}", fields[f]) for f in ("fx", "fy", "cx", "cy"))
    k1, k2, k3 = vector(file, f"{name} k", fields["k"], 3, "k1 k2 k3")
    p1, p2 = vector(file, f"{name} p", fields["p"], 2, "p1 p2")
    turned = rotation(file, f"{name} R", fields["R"])
    place = vector(file, f"{name} T", fields["T"], 3, "x y z")
    return RawCamera(
        name=name,
        intrinsics=focal_and_centre(fx, fy, cx, cy),
        distortion=vector(file, name, [k1, k2, p1, p2, k3], 5, "lens"),
        rotation=turned,
        translation=-turned @ place,
        convention=_CONVENTION,
    )
