"""Pictures of coloured heads that move in front of a wall, as a sequence folder's values."""

from __future__ import annotations

from collections.abc import Sequence as Many
from pathlib import Path

import cv2
import numpy as np
from numpy import ndarray

from tests.engine.synthetic import CAMERAS, HALF_EXTENTS, ROOM
from tracker.geometry.camera import Camera
from tracker.sequences.sequence import GroundTruth, Sequence, Template, View
from tracker.single_view.box_sizes import upright_boxes

Colour = tuple[float, float, float]

RED: tuple[Colour, Colour] = ((30.0, 30.0, 60.0), (60.0, 70.0, 200.0))
"""Hair and face, BGR."""
GREEN: tuple[Colour, Colour] = ((20.0, 70.0, 40.0), (70.0, 190.0, 60.0))


def wall(camera: Camera, seed: int = 0) -> ndarray:
    """A wall with a few grey things on it."""
    width, height = camera.image_size
    rng = np.random.default_rng(seed)
    picture = np.full((height, width, 3), (175.0, 190.0, 195.0))
    for _ in range(10):
        x, y = rng.integers(0, width - 40), rng.integers(0, height - 40)
        picture[y : y + 30, x : x + 40] = rng.uniform(60, 220)
    return picture


def paint(
    background: ndarray, boxes: ndarray, colours: Many[tuple[Colour, Colour]], seed: int
) -> ndarray:
    """Heads in front of it, the first one hindmost, seen by a noisy sensor."""
    picture = background.copy()
    for (x, y, half_x, half_y), (hair, face) in zip(boxes, colours, strict=True):
        centre, axes = (round(x), round(y)), (max(1, round(half_x)), max(1, round(half_y)))
        cv2.ellipse(picture, centre, axes, 0, 0, 360, face, -1)
        cv2.ellipse(picture, centre, axes, 0, 180, 360, hair, -1)
    noise = np.random.default_rng(seed).normal(0.0, 2.0, picture.shape)
    return np.clip(np.rint(picture + noise), 0, 255).astype(np.uint8)


def painted_sequence(
    folder: Path,
    paths: Many[ndarray],
    colours: Many[tuple[Colour, Colour]],
    *,
    camera: Camera = CAMERAS[0],
    half_extents: ndarray = HALF_EXTENTS,
    template_step: int | None = None,
) -> Sequence:
    """People along their paths (steps, 3), one camera; a template of each from one step."""
    steps = len(paths[0])
    template_step = steps // 2 if template_step is None else template_step
    background = wall(camera)
    images = []
    for step in range(steps):
        boxes, _ = upright_boxes(camera, np.array([path[step] for path in paths]), half_extents)
        images.append(folder / f"{step:04d}.png")
        cv2.imwrite(str(images[-1]), paint(background, boxes, colours, step))
    boxes, _ = upright_boxes(camera, np.array([p[template_step] for p in paths]), half_extents)
    templates = tuple(
        Template(f"person{i + 1}", camera.name, template_step, corner_box(box))
        for i, box in enumerate(boxes)
    )
    return Sequence(
        name="painted",
        folder=folder,
        fps=25.0,
        frames=steps,
        room=ROOM,
        target_half_extents=half_extents,
        views=(View(camera, images=tuple(images)),),
        templates=templates,
        ground_truth=GroundTruth(
            frames=np.repeat(np.arange(steps), len(paths)),
            ids=np.tile(np.arange(1, len(paths) + 1), steps),
            positions=np.stack(paths, axis=1).reshape(-1, 3),
            valid=np.ones(steps * len(paths), dtype=bool),
        ),
        digest="painted",
    )


def corner_box(box: ndarray) -> ndarray:
    """Left, top, width and height of a box given by centre and half sizes."""
    return np.array([box[0] - box[2], box[1] - box[3], 2 * box[2], 2 * box[3]])
