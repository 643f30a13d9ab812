"""A recording as long as wished: several cameras with video, boxes and truth of a few walkers."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from tests.benchmarks.engine.growth import ring, walkers
from tests.engine import synthetic
from tests.synthetic import write_lines

PICTURES = 50
"""Different pictures of a video, shown again and again: painting would take longest."""


def write_long(
    folder: Path, frames: int, *, cameras: int = 4, size: tuple[int, int] = (64, 48)
) -> Path:
    """A sequence folder of ``frames`` steps; motion JPEG, as many recorders write it."""
    folder.mkdir(parents=True)
    views = ring(cameras)
    scale = np.array([size[0] / 360.0, size[1] / 288.0, 1.0])
    whole = synthetic.sequence(walkers(3, frames), frames, views, clutter_rate=0.2, pixel_noise=0.3)
    room, truth = whole.room, whole.ground_truth
    assert truth is not None
    lines = [
        "format = 1",
        'name = "long"',
        "fps = 25.0",
        f"frames = {frames}",
        "[room]",
        f"min = {room.minimum.tolist()}",
        f"max = {room.maximum.tolist()}",
        "[target]",
        f"half_extents = {whole.target_half_extents.tolist()}",
    ]
    rng = np.random.default_rng(0)
    for view in whole.views:
        camera, boxes = view.camera, view.detections
        assert boxes is not None
        writer = cv2.VideoWriter(
            str(folder / f"{camera.name}.avi"),
            cv2.CAP_FFMPEG,
            cv2.VideoWriter.fourcc(*"MJPG"),
            25.0,
            size,
        )
        coarse = rng.integers(30, 220, (PICTURES, 6, 8, 3), dtype=np.uint8)
        pictures = [cv2.resize(picture, size) for picture in coarse]
        for step in range(frames):
            writer.write(pictures[step % PICTURES])
        writer.release()
        rows = boxes.boxes * np.tile(scale[:2], 2)
        write_lines(
            folder / f"{camera.name}.csv",
            "frame,left,top,width,height,score",
            [
                f"{frame}," + ",".join(f"{value:.2f}" for value in row) + ",1"
                for frame, row in zip(boxes.frames.tolist(), rows.tolist(), strict=True)
            ],
        )
        lines += [
            "[[camera]]",
            f'name = "{camera.name}"',
            f"image_size = {list(size)}",
            f'video = "{camera.name}.avi"',
            f'detections = "{camera.name}.csv"',
            f"K = {(np.diag(scale) @ camera.intrinsics).tolist()}",
            f"distortion = {camera.distortion.tolist()}",
            f"R = {camera.rotation.tolist()}",
            f"t = {camera.translation.tolist()}",
        ]
    write_lines(
        folder / "truth.csv",
        "frame,id,x,y,z",
        [
            f"{frame},{person}," + ",".join(f"{value:.4f}" for value in place)
            for frame, person, place in zip(
                truth.frames.tolist(), truth.ids.tolist(), truth.positions.tolist(), strict=True
            )
        ],
    )
    lines += ["[ground_truth]", 'file = "truth.csv"', ""]
    (folder / "sequence.toml").write_text("\n".join(lines), encoding="utf-8")
    return folder
