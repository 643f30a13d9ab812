"""nerfstudio's and instant-ngp's ``transforms.json``: camera to world, OpenGL axes.

Scale and up are those of the reconstruction. Pixels have their origin at the corner of the
top-left pixel, as COLMAP's have, from which the numbers come.

Source: Tancik et al., "Nerfstudio", SIGGRAPH 2023, and its "Data conventions".
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import PurePosixPath
from typing import Any

import numpy as np

from tracker.io.read.calibration.reconstruction.colmap import MODELS, MOST_IMAGES, model_lens
from tracker.io.read.pieces import CalibrationPiece, Convention, Piece, RawCamera
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import SourceFile
from tracker.io.read.values import image_size, matrix, need, number, rotation

NAME = "nerfstudio transforms.json"
KIND: Kind = "calibration"
SERIES = False

_CONVENTION = Convention(direction="camera-to-world", axes="opengl")


def recognise(file: SourceFile) -> Certainty:
    """JSON with frames that have a ``transform_matrix``."""
    head = file.head_text
    is_it = head.lstrip()[:1] == "{" and '"transform_matrix"' in head and '"frames"' in head
    return Certainty.SURE if is_it else Certainty.NO


def read(file: SourceFile) -> Iterator[Piece]:
    """One piece with a camera a frame."""
    need(file, file.json, ("frames",))
    frames = file.json["frames"]
    if not isinstance(frames, list) or not frames or len(frames) > MOST_IMAGES:
        count = len(frames) if isinstance(frames, list) else 0
        raise file.error(
            f"has {count} images, expected one image a camera that stands still, "
            f"from 1 to {MOST_IMAGES}",
            "frames",
        )
    cameras = tuple(_camera(file, place, frame) for place, frame in enumerate(frames))
    yield CalibrationPiece(file.path, NAME, cameras)


def _camera(file: SourceFile, place: int, frame: Any) -> RawCamera:
    where = f"frames {place}"
    need(file, frame, ("transform_matrix",), where)
    values: dict[str, Any] = {**file.json, **frame}
    need(file, values, ("w", "h"), where)  # Blender's scenes for NeRF have to be given these
    if "camera_angle_x" in values:
        angle = number(file, f"{where}, camera_angle_x", values["camera_angle_x"])
        width, height = image_size(file, where, [values["w"], values["h"]])
        values.setdefault("fl_x", width / 2.0 / np.tan(angle / 2.0))
        values.setdefault("cx", width / 2.0)
        values.setdefault("cy", height / 2.0)
    need(file, values, ("fl_x", "cx", "cy"), where)
    model = str(values.get("camera_model", "OPENCV"))
    names = {"fx": "fl_x", "fy": "fl_y"}
    values.setdefault("fl_y", values["fl_x"])
    parts = MODELS.get(model, ("", ()))[1]
    needed = ("fx", "fy", "f", "cx", "cy")
    found = {
        part: number(file, f"{where}, {part}", values.get(names.get(part, part), 0.0))
        for part in ({*parts, *needed} - {"f"})
    }
    k, distortion, lens = model_lens(file, where, model, found)
    pose = matrix(file, f"{where}, transform_matrix", frame["transform_matrix"], 4, 4)
    return RawCamera(
        name=PurePosixPath(str(frame.get("file_path", place))).with_suffix("").as_posix(),
        image_size=image_size(file, where, [values["w"], values["h"]]),
        intrinsics=k,
        distortion=distortion,
        lens=lens,
        rotation=rotation(file, f"{where}, transform_matrix", pose[:3, :3]),
        translation=pose[:3, 3],
        convention=_CONVENTION,
    )
