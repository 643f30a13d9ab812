"""A small room, rendered, in which two people meet, are hidden, and turn back: a trap for a filter.

Who walks on as he walked passes the other; these two do not, so a filter that trusts their
velocity exchanges them.
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tests.synthetic import camera_toml, head_toml, write_lines
from tracker.sequences.reader import read_sequence
from tracker.sequences.sequence import Sequence

FRAMES = 100
MEET = 34
"""The step at which they turn back."""
HIDDEN = range(28, 48)
"""Steps at which no camera tells them apart, nor finds either."""
SIZE = (384, 288)
_COLOURS = {1: (40, 40, 200), 2: (200, 120, 40)}
_FAR, _NEAR = 1.2, 0.06


def write_meeting(folder: Path) -> Path:
    """A sequence of two cameras: person 1 stays at x < 0 and person 2 at x > 0."""
    folder.mkdir(parents=True, exist_ok=True)
    text = head_toml(FRAMES, "meeting").replace(
        "entrances = [",
        "entrances = [\n  { position = [-1.2, 0.0, 0.84], sigma = [0.3, 0.4, 0.15] },",
    )
    names = ("cam1", "cam2")
    path = folder / "sequence.toml"
    bare = "".join(camera_toml(name, SIZE) + "\n" for name in names)
    path.write_text(text + bare, encoding="utf-8")
    sequence = read_sequence(folder)  # its cameras, to render with
    for index, name in enumerate(names):
        _render(folder, name, sequence, index)
        text += (
            camera_toml(name, SIZE, [f'video = "{name}.mp4"', f'detections = "{name}.csv"']) + "\n"
        )
    text += '[ground_truth]\nfile = "ground_truth.csv"\n'
    write_lines(
        folder / "ground_truth.csv",
        "frame,id,x,y,z,valid",
        [
            f"{step},{person},{x:.4f},{y:.4f},{z:.4f},1"
            for step in range(FRAMES)
            for person, (x, y, z) in _people(step).items()
        ],
    )
    path.write_text(text, encoding="utf-8")
    return folder


def _people(step: int) -> dict[int, Float[ndarray, " 3"]]:
    """Where both are: towards each other, then back."""
    away = _NEAR + (_FAR - _NEAR) * min(1.0, abs(step - MEET) / MEET)
    return {1: np.array([-away, 0.05, 0.84]), 2: np.array([away, -0.05, 0.84])}


def _render(folder: Path, name: str, sequence: Sequence, index: int) -> None:
    camera = sequence.cameras[index]
    rng = np.random.default_rng(index)
    video = cv2.VideoWriter(
        str(folder / f"{name}.mp4"), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*"mp4v"), 25.0, SIZE
    )
    rows = []
    for step in range(FRAMES):
        picture = np.full((SIZE[1], SIZE[0], 3), (150, 160, 165), dtype=np.uint8)
        picture[SIZE[1] * 55 // 100 :] = (90, 110, 130)
        people = sorted(
            _people(step).items(), key=lambda one: -np.linalg.norm(one[1] - camera.centre)
        )
        for person, position in people:
            (box,), _ = camera.project_boxes(position[None], sequence.target_half_extents)
            left, top, width, height = box
            head = (round(left + width / 2), round(top + height * 0.1))
            cv2.circle(picture, head, round(height * 0.08), (150, 180, 220), -1)
            corner = (round(left + width * 0.25), round(top + height * 0.18))
            other = (round(left + width * 0.75), round(top + height * 0.97))
            cv2.rectangle(picture, corner, other, _COLOURS[person], -1)
            if step not in HIDDEN:
                left, top, width, height = box + rng.normal(0.0, 0.6, 4)
                rows.append(f"{step},{left:.2f},{top:.2f},{width:.2f},{height:.2f},0.9")
        video.write(picture)
    video.release()
    write_lines(folder / f"{name}.csv", "frame,left,top,width,height,score", rows)
