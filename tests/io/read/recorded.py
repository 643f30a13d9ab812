"""A small recording on disk as other programs leave it: calibration, boxes, videos."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy import ndarray
from scipy.spatial.transform import Rotation

from tests.io.read.rig import SIZE, boxes, cameras, walks
from tracker.io.importing.gathering import gather
from tracker.io.importing.options import ImportOptions
from tracker.io.importing.settling import ImportPlan, settle

PLACES = walks()


def toml(folder: Path, *, scale: float = 1.0, size: tuple[int, int] = SIZE) -> None:
    """Anipose's calibration, whose unit nobody knows."""
    lines = []
    for camera in cameras():
        k = np.diag([size[0] / SIZE[0], size[1] / SIZE[1], 1.0]) @ camera.intrinsics
        lines += [
            f'[{camera.name}]\nname = "{camera.name}"\nsize = {list(size)}',
            f"matrix = {k.tolist()}\ndistortions = {camera.distortion.tolist()}",
            f"rotation = {Rotation.from_matrix(camera.rotation).as_rotvec().tolist()}",
            f"translation = {(scale * camera.translation).tolist()}",
        ]
    (folder / "calibration.toml").write_text("\n".join(lines))


def detections(
    folder: Path, first: int = 0, *, size: tuple[int, int] = SIZE, places: ndarray = PLACES
) -> None:
    for camera in cameras():
        frames, found = boxes(camera, places)
        found = found * np.tile(np.array(size) / SIZE, 2)
        rows = [
            f"{f + first},{','.join(map(str, b))}"
            for f, b in zip(frames, found.tolist(), strict=True)
        ]
        path = folder / f"{camera.name}.csv"
        path.write_text("\n".join(["frame,left,top,width,height", *rows]))


def videos(folder: Path, size: tuple[int, int] = SIZE, frames: int = 60) -> None:
    for camera in cameras():
        path = str(folder / f"{camera.name}.avi")
        writer = cv2.VideoWriter(path, cv2.VideoWriter.fourcc(*"MJPG"), 20.0, size)
        for _ in range(frames):
            writer.write(np.zeros((size[1], size[0], 3), np.uint8))
        writer.release()


def settled_of(folder: Path, options: ImportOptions | None = None) -> ImportPlan:
    return settle(gather([folder]), options)
