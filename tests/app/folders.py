"""Sequence folders on disk for tests of the workbench and the command line."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tests.engine import synthetic
from tests.synthetic import write_lines

FRAMES = 120


def write_crossing(folder: Path, frames: int = FRAMES, *, name: str = "crossing") -> Path:
    """Two people who cross a room, as the boxes of three cameras with their truth."""
    sequence = synthetic.sequence(synthetic.crossing(frames), frames, clutter_rate=0.3)
    folder.mkdir(parents=True, exist_ok=True)
    room, half = sequence.room, sequence.target_half_extents
    lines = [
        "format = 1",
        f'name = "{name}"',
        'description = "two people cross a room"',
        f"fps = {sequence.fps}",
        f"frames = {frames}",
        "[room]",
        f"min = {room.minimum.tolist()}",
        f"max = {room.maximum.tolist()}",
        "entrances = [",
        *(
            f"  {{ position = {e.position.tolist()}, sigma = {e.sigma.tolist()} }},"
            for e in room.entrances
        ),
        "]",
        "[target]",
        f"half_extents = {half.tolist()}",
    ]
    for view in sequence.views:
        camera, boxes = view.camera, view.detections
        assert boxes is not None
        lines += [
            "[[camera]]",
            f'name = "{camera.name}"',
            f"image_size = {list(camera.image_size)}",
            f'detections = "{camera.name}.csv"',
            f"K = {camera.intrinsics.tolist()}",
            f"distortion = {camera.distortion.tolist()}",
            f"R = {camera.rotation.tolist()}",
            f"t = {camera.translation.tolist()}",
        ]
        rows = np.column_stack([boxes.frames, boxes.boxes, boxes.scores]).tolist()
        write_lines(
            folder / f"{camera.name}.csv",
            "frame,left,top,width,height,score",
            [f"{int(row[0])}," + ",".join(f"{v:.3f}" for v in row[1:]) for row in rows],
        )
    truth = sequence.ground_truth
    assert truth is not None
    write_lines(
        folder / "truth.csv",
        "frame,id,x,y,z",
        [
            f"{frame},{person}," + ",".join(f"{v:.4f}" for v in place)
            for frame, person, place in zip(
                truth.frames.tolist(), truth.ids.tolist(), truth.positions.tolist(), strict=True
            )
        ],
    )
    lines += ["[ground_truth]", 'file = "truth.csv"', ""]
    (folder / "sequence.toml").write_text("\n".join(lines), encoding="utf-8")
    return folder
