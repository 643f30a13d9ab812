"""Camera calibrations for other programs: OpenCV's FileStorage, and Pose2Sim's TOML.

In both, rotation and translation map world coordinates (metres, z up) to camera coordinates in
OpenCV's axes.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import cv2
import numpy as np

from tracker.files.atomic import write_whole
from tracker.geometry.camera import Camera

Form = Literal["opencv", "pose2sim"]

WRITTEN = ("OpenCV FileStorage (calibration)", "Pose2Sim TOML (calibration)")


def save_calibration(path: Path, cameras: Sequence[Camera], form: Form) -> None:
    """Write all cameras into one file.

    In OpenCV's form there are ``K_NAME``, ``D_NAME``, ``R_NAME``, ``T_NAME`` and ``size_NAME``, as
    YAML, or as XML or JSON where the file's suffix is one of these. In Pose2Sim's form there is a
    table for each camera.

    Args:
        path: The file to write; an existing one is replaced.
        cameras: The cameras, each with a name of its own.
        form: The program that is to read the file.

    Raises:
        ValueError: If two cameras would have the same name in the file.
    """
    keys = [re.sub(r"\W", "_", camera.name) for camera in cameras]
    if len(set(keys)) < len(keys):
        raise ValueError(
            f"{path.name}: two cameras are called {keys} but for signs that the format does not "
            "have; rename one"
        )
    if form == "opencv":
        _save_opencv(path, cameras, keys)
    else:
        text = "\n".join(map(_table, keys, cameras)) + _END
        write_whole(path, text.encode("utf-8"))


_END = "\n[metadata]\nadjusted = false\nerror = 0.0\n"


def _save_opencv(path: Path, cameras: Sequence[Camera], keys: Sequence[str]) -> None:
    suffix = path.suffix.lower() if path.suffix.lower() in (".xml", ".json") else ".yml"
    storage = cv2.FileStorage(suffix, cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    try:
        for key, camera in zip(keys, cameras, strict=True):
            storage.write(f"size_{key}", np.array([camera.image_size], dtype=np.int32))
            storage.write(f"K_{key}", np.asarray(camera.intrinsics, dtype=float))
            storage.write(f"D_{key}", np.asarray(camera.distortion, dtype=float)[:, None])
            storage.write(f"fisheye_{key}", int(camera.fisheye))
            storage.write(f"R_{key}", np.asarray(camera.rotation, dtype=float))
            storage.write(f"T_{key}", np.asarray(camera.translation, dtype=float)[:, None])
    finally:
        text = storage.releaseAndGetString()
    write_whole(path, text.encode("utf-8"))


def _table(key: str, camera: Camera) -> str:
    from scipy.spatial.transform import Rotation  # a server starts without it

    vector = Rotation.from_matrix(camera.rotation).as_rotvec()
    return "\n".join(
        [
            f"[{key}]",
            f"name = {json.dumps(camera.name)}",
            f"size = [{float(camera.image_size[0])}, {float(camera.image_size[1])}]",
            f"matrix = {camera.intrinsics.tolist()}",
            f"distortions = {camera.distortion.tolist()}",
            f"rotation = {vector.tolist()}",
            f"translation = {camera.translation.tolist()}",
            f"fisheye = {str(camera.fisheye).lower()}",
            "",
        ]
    )
