"""TOML with a table a camera: Anipose, Pose2Sim and Caliscope.

Each table has ``matrix``, ``distortions``, ``rotation`` (Rodrigues' vector, or in Caliscope
the matrix) and ``translation``, world to camera in OpenCV's axes. Pose2Sim and Caliscope
write metres; Anipose writes the unit that the board was given in.

Sources: aniposelib ``CameraGroup.dump`` (Karashchuk et al., "Anipose", Cell Reports 2021);
Pagnon, Domalain, Reveret, "Pose2Sim", JOSS 2022; Caliscope ``camera_array.toml``.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from tracker.io.read.pieces import CalibrationPiece, Convention, FormatError, Piece, RawCamera
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import SourceFile
from tracker.io.read.values import image_size, intrinsics, lens, need, rotation, vector

NAME = "Anipose, Pose2Sim or Caliscope TOML"
KIND: Kind = "calibration"
SERIES = False

_NEEDED = ("matrix", "distortions")


def recognise(file: SourceFile) -> Certainty:
    """TOML in which some table has a camera's matrix and distortions."""
    head = file.head_text
    if "matrix" not in head or "distortions" not in head or "[" not in head:
        return Certainty.NO
    try:
        return Certainty.SURE if any(_tables(file.toml)) else Certainty.NO
    except FormatError:
        if head.lstrip().startswith(("{", "<")):
            return Certainty.NO
        raise


def read(file: SourceFile) -> Iterator[Piece]:
    """One piece with every camera; a camera that Caliscope was told to ignore is left out."""
    program = _program(file.toml)
    convention = Convention(
        unit=None if program == "Anipose" else "m",
        direction="world-to-camera",
        axes="opencv",
    )
    cameras = []
    for key, table in _tables(file.toml):
        if table.get("ignore") is True:
            continue
        need(file, table, _NEEDED, key)
        distortion, model = lens(
            file, f"{key}.distortions", table["distortions"], fisheye=table.get("fisheye") is True
        )
        posed = "rotation" in table and "translation" in table
        size = table.get("size")
        cameras.append(
            RawCamera(
                name=str(table.get("name", key.removeprefix("cameras."))),
                image_size=None if size is None else image_size(file, f"{key}.size", size),
                intrinsics=intrinsics(file, f"{key}.matrix", table["matrix"]),
                distortion=distortion,
                lens=model,
                rotation=rotation(file, f"{key}.rotation", table["rotation"]) if posed else None,
                translation=vector(file, f"{key}.translation", table["translation"], 3, "x y z")
                if posed
                else None,
                convention=convention,
            )
        )
    yield CalibrationPiece(file.path, f"{program} TOML", tuple(cameras))


def _tables(values: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Every camera's key and table; Caliscope has them one level down, in ``cameras``."""
    inner = values.get("cameras")
    for prefix, tables in (("cameras.", inner), ("", values)):
        for key, table in tables.items() if isinstance(tables, dict) else ():
            if isinstance(table, dict) and all(name in table for name in _NEEDED):
                yield f"{prefix}{key}", table


def _program(values: dict[str, Any]) -> str:
    """Caliscope counts turns of the picture; Pose2Sim says of every camera whether it is one of
    a fisheye, Anipose only of those that are."""
    tables = [table for _, table in _tables(values)]
    if any("rotation_count" in table or "grid_count" in table for table in tables):
        return "Caliscope"
    return "Pose2Sim" if any(table.get("fisheye") is False for table in tables) else "Anipose"
