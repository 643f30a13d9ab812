"""Small sequence folders whose every frame carries its own number, for any test to open.

The number is drawn as a row of large black and white squares, which every codec leaves
readable, so a test can ask a picture which frame it is.
"""

from __future__ import annotations

from collections.abc import Sequence as Many
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
from numpy import ndarray

BITS = 12
"""Squares that carry the number: up to 4095."""

Container = Literal["mp4", "mjpg.avi", "xvid.avi", "mp4v.avi", "images"]
CODECS = {"mp4": "mp4v", "mjpg.avi": "MJPG", "xvid.avi": "XVID", "mp4v.avi": "mp4v"}

POSES = {
    "cam1": (
        [[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]],
        [0.0, 1.0, 4.0],
    ),
    "cam2": (
        [[-1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, -1.0, 0.0]],
        [0.0, 1.0, 4.0],
    ),
    "cam3": (
        [[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]],
        [0.0, 1.0, 4.0],
    ),
}
"""R and t of cameras 4 m from the middle of the room, at height 1 m, looking level at it."""


def numbered_picture(number: int, size: tuple[int, int] = (192, 144), shade: int = 0) -> ndarray:
    """A picture of coloured noise that says its number; ``shade`` tells cameras apart."""
    width, height = size
    rng = np.random.default_rng(number)
    coarse = rng.integers(40, 200, (max(2, height // 24), max(2, width // 24), 3), dtype=np.uint8)
    picture = cv2.resize(coarse, size, interpolation=cv2.INTER_LINEAR)
    picture[:, :, shade % 3] = picture[:, :, shade % 3] // 2
    side = width // BITS
    for bit in range(BITS):
        picture[:side, bit * side : (bit + 1) * side] = 255 if number >> bit & 1 else 0
    return np.asarray(picture, dtype=np.uint8)


def number_in(picture: ndarray) -> int:
    """The number that a picture says it is."""
    side = picture.shape[1] // BITS
    middle = picture[side // 4 : side - side // 4, : BITS * side].mean(axis=(0, 2))
    squares = middle.reshape(BITS, side)[:, side // 4 : side - side // 4].mean(axis=1)
    return sum(1 << bit for bit in range(BITS) if squares[bit] > 127.0)


def write_video(
    path: Path,
    numbers: Many[int],
    codec: str,
    size: tuple[int, int] = (192, 144),
    shade: int = 0,
) -> None:
    """A video of the frames with these numbers."""
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*codec), 25.0, size)
    assert writer.isOpened(), f"this OpenCV cannot write {codec}"
    for number in numbers:
        writer.write(numbered_picture(number, size, shade))
    writer.release()


def camera_toml(
    name: str, size: tuple[int, int] = (192, 144), lines: Many[str] = (), pose: str | None = None
) -> str:
    """One ``[[camera]]`` table; ``lines`` name its video, images, detections."""
    rotation, translation = POSES[pose or name]
    width, height = size
    x, y = (width - 1) / 2, (height - 1) / 2
    return "\n".join(
        [
            "[[camera]]",
            f'name = "{name}"',
            f"image_size = [{width}, {height}]",
            *lines,
            f"K = [[{width}.0, 0, {x}], [0, {width}.0, {y}], [0, 0, 1]]",
            f"R = {rotation}",
            f"t = {translation}",
            "",
        ]
    )


def head_toml(frames: int, name: str = "numbers") -> str:
    """Everything before the cameras."""
    return f"""format = 1
name = "{name}"
description = "frames that carry their number"
fps = 25.0
frames = {frames}

[room]
min = [-1.5, -1.5, 0.0]
max = [1.5, 1.5, 2.0]
entrances = [
  {{ position = [1.4, 0.0, 1.0], sigma = [0.3, 0.3, 0.15] }},
]

[target]
half_extents = [0.3, 0.3, 0.84]

"""


def write_sequence(
    folder: Path,
    *,
    frames: int = 40,
    cameras: int = 2,
    container: Container | None = "mp4",
    first_frame: int = 0,
    size: tuple[int, int] = (192, 144),
    detections: bool = False,
    truth: bool = True,
    templates: bool = True,
) -> Path:
    """A sequence folder: at step k each picture says ``first_frame + k``.

    Args:
        folder: Made if it is not there.
        frames: Steps.
        cameras: One to three, around the room.
        container: Kind of video, ``"images"`` for JPEG files, None for no pictures.
        first_frame: Frames in the files before step 0.
        size: Of the pictures.
        detections: Whether each camera has one box a step, moving right by a pixel a step.
        truth: Whether there is a ground truth: one person who walks along x.
        templates: Whether there is a template; needs pictures.
    """
    folder.mkdir(parents=True, exist_ok=True)
    text = head_toml(frames)
    numbers = range(first_frame + frames)
    names = list(POSES)[:cameras]
    for shade, name in enumerate(names):
        lines = []
        if container == "images":
            (folder / name).mkdir()
            for number in numbers:
                picture = numbered_picture(number, size, shade)
                cv2.imwrite(str(folder / name / f"{number:05d}.jpg"), picture)
            lines.append(f'images = "{name}/*.jpg"')
        elif container is not None:
            file = f"{name}.{container.rpartition('.')[2]}"
            write_video(folder / file, numbers, CODECS[container], size, shade)
            lines.append(f'video = "{file}"')
        if first_frame:
            lines.append(f"first_frame = {first_frame}")
        if detections:
            rows = [f"{k},{20 + k}.5,30.25,24,48,0.9" for k in range(frames)]
            write_lines(folder / f"{name}.csv", "frame,left,top,width,height,score", rows)
            lines.append(f'detections = "{name}.csv"')
        text += camera_toml(name, size, lines) + "\n"
    if templates and container is not None:
        text += f'[[template]]\nname = "person1"\ncamera = "{names[0]}"\nframe = {frames // 2}\n'
        text += "box = [60, 50, 24, 48]\n\n"
    if truth:
        rows = [f"{k},1,{-1 + 2 * k / frames:.4f},0.2,0.84,{int(k % 5 > 0)}" for k in range(frames)]
        write_lines(folder / "ground_truth.csv", "frame,id,x,y,z,valid", rows)
        text += '[ground_truth]\nfile = "ground_truth.csv"\n'
    (folder / "sequence.toml").write_text(text, encoding="utf-8")
    return folder


def write_lines(path: Path, header: str, rows: Many[str]) -> None:
    """A CSV file."""
    path.write_text("\n".join([header, *rows, ""]), encoding="utf-8")
