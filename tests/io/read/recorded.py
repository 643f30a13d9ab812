"""A small recording on disk as other programs leave it: calibration, boxes, videos."""

from __future__ import annotations

from collections.abc import Callable, Iterable
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
HEAD = "frame,left,top,width,height"


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


def table(path: Path, frames: Iterable[object], found: ndarray, head: str = HEAD) -> None:
    """Write the frame of each row, or what else tells it, and the four numbers of a box."""
    rows = [f"{f},{','.join(map(str, b))}" for f, b in zip(frames, found.tolist(), strict=True)]
    path.write_text("\n".join([head, *rows]))


def detections(
    folder: Path,
    first: int = 0,
    *,
    size: tuple[int, int] = SIZE,
    places: ndarray = PLACES,
    head: str = HEAD,
    written: Callable[[ndarray], ndarray] = np.asarray,
) -> None:
    """Write the boxes of all cameras, their four numbers as a function makes them of ltwh."""
    for camera in cameras():
        frames, found = boxes(camera, places)
        found = found * np.tile(np.array(size) / SIZE, 2)
        table(folder / f"{camera.name}.csv", frames + first, written(found), head)


def assert_boxes(plan: ImportPlan, places: ndarray = PLACES, tolerance: float = 1e-6) -> None:
    """Each camera has its boxes at their frames."""
    for view, camera in zip(plan.views, cameras(), strict=True):
        assert view.detections is not None
        frames, found = boxes(camera, places)
        np.testing.assert_array_equal(view.detections.frames, frames)
        np.testing.assert_allclose(view.detections.boxes, found, atol=tolerance)


def videos(folder: Path, size: tuple[int, int] = SIZE, frames: int = 60) -> None:
    for camera in cameras():
        path = str(folder / f"{camera.name}.avi")
        writer = cv2.VideoWriter(path, cv2.VideoWriter.fourcc(*"MJPG"), 20.0, size)
        for _ in range(frames):
            writer.write(np.zeros((size[1], size[0], 3), np.uint8))
        writer.release()


def settled_of(folder: Path, options: ImportOptions | None = None) -> ImportPlan:
    return settle(gather([folder]), options)
