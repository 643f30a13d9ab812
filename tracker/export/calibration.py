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
"""The names of the forms, which the command line lists."""


def save_calibration(path: Path, cameras: Sequence[Camera], form: Form) -> None:
    """Write all cameras into one file.

    In OpenCV's form each camera has the entries ``size_NAME`` (pixels), ``K_NAME`` (intrinsics),
    ``D_NAME`` (distortion), ``fisheye_NAME``, ``R_NAME`` (rotation) and ``T_NAME`` (translation);
    the file is XML or JSON if its suffix says so, and else YAML. In Pose2Sim's form each camera has
    a table.

    Args:
        path: The file to write; an existing one is replaced.
        cameras: The cameras, with different names.
        form: The form of the file, by the program that reads it.

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
"""The last table of Pose2Sim's form."""


def _save_opencv(path: Path, cameras: Sequence[Camera], keys: Sequence[str]) -> None:
    """Write the cameras in OpenCV's form, each under its key."""
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
    """Return the table of a camera in Pose2Sim's form."""
    from scipy.spatial.transform import Rotation  # imported late, so that a server starts faster

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
