"""Kalibr's ``camchain.yaml``: each camera by its pose to the one before it, metres.

The world is the first camera: its axes lie as the camera hung, so up has to be found out.

Source: Furgale, Rehder, Siegwart, "Unified temporal and spatial calibration for multi-sensor
systems", IROS 2013; Kalibr, "YAML formats".
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from tracker.io.read.pieces import CalibrationPiece, Convention, FormatError, Piece, RawCamera
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import SourceFile
from tracker.io.read.values import (
    focal_and_centre,
    image_size,
    lens,
    matrix,
    need,
    rotation,
    shown,
    vector,
)

NAME = "Kalibr camchain YAML"
KIND: Kind = "calibration"
SERIES = False

_CONVENTION = Convention(unit="m", direction="world-to-camera", axes="opencv")


def recognise(file: SourceFile) -> Certainty:
    """YAML with tables ``cam0`` … that have intrinsics and a distortion_model."""
    head = file.head_text
    if "cam0" not in head or "distortion_model" not in head or "intrinsics" not in head:
        return Certainty.NO
    try:
        return Certainty.SURE if isinstance(file.yaml, dict) else Certainty.NO
    except FormatError:
        return Certainty.NO


def read(file: SourceFile) -> Iterator[Piece]:
    """One piece with every camera, in the order of the chain."""
    tables = {key: value for key, value in file.yaml.items() if str(key).startswith("cam")}
    pose = np.eye(4)
    cameras = []
    for place, (key, table) in enumerate(tables.items()):
        need(file, table, ("intrinsics", "resolution", "distortion_coeffs"), str(key))
        if place:
            need(file, table, ("T_cn_cnm1",), str(key))
            field = f"{key}.T_cn_cnm1"
            step = matrix(file, field, table["T_cn_cnm1"], 4, 4)
            rotation(file, field, step[:3, :3])
            pose = step @ pose
        cameras.append(_camera(file, str(key), table, pose.copy()))
    yield CalibrationPiece(file.path, NAME, tuple(cameras))


def _camera(file: SourceFile, key: str, table: dict[str, Any], pose: Any) -> RawCamera:
    model = table.get("camera_model", "pinhole")
    distortion_model = table.get("distortion_model", "none")
    if model != "pinhole" or distortion_model not in ("radtan", "equidistant", "none"):
        raise file.error(
            f"has a lens of the model {shown(f'{model}-{distortion_model}')}, expected "
            "pinhole-radtan or pinhole-equi; calibrate with one of those",
            key,
        )
    fx, fy, cx, cy = vector(file, f"{key}.intrinsics", table["intrinsics"], 4, "fu fv pu pv")
    given = [] if distortion_model == "none" else table["distortion_coeffs"]
    distortion, kind = lens(
        file, f"{key}.distortion_coeffs", given, fisheye=distortion_model == "equidistant"
    )
    return RawCamera(
        name=key,
        image_size=image_size(file, f"{key}.resolution", table["resolution"]),
        intrinsics=focal_and_centre(fx, fy, cx, cy),
        distortion=distortion,
        lens=kind,
        rotation=pose[:3, :3],
        translation=pose[:3, 3],
        convention=_CONVENTION,
    )
