"""Pictures of a still scene, with somebody before it, from a camera that shakes."""

from __future__ import annotations

import cv2
import numpy as np
from numpy import ndarray

SIZE = (320, 240)
MIDDLE = np.array([(SIZE[0] - 1) / 2, (SIZE[1] - 1) / 2])


def scene(rng: np.random.Generator) -> ndarray:
    """Furniture: rectangles of all greys, a little larger than a picture of it."""
    room = np.full((SIZE[1] + 60, SIZE[0] + 60, 3), 128, dtype=np.uint8)
    for _ in range(80):
        x, y = rng.integers(0, [SIZE[0], SIZE[1]]) + rng.integers(0, 60, 2)
        w, h = rng.integers(8, 70, 2)
        colour = rng.integers(30, 225, 3).tolist()
        cv2.rectangle(room, (int(x), int(y)), (int(x + w), int(y + h)), colour, -1)
    return np.asarray(cv2.GaussianBlur(room, (0, 0), 1.0))


def taken(room: ndarray, moved: ndarray, rng: np.random.Generator, light: float = 1.0) -> ndarray:
    """What a camera sees that is shifted and turned so, with somebody before the scene."""
    cos, sin = np.cos(moved[2]), np.sin(moved[2])
    turn = np.array([[cos, -sin], [sin, cos]])
    matrix = np.column_stack([turn, MIDDLE - turn @ MIDDLE + moved[:2] - turn @ [30.0, 30.0]])
    picture = cv2.warpAffine(room, matrix, SIZE, flags=cv2.INTER_CUBIC).astype(float)
    x, y = rng.integers([20, 40], [SIZE[0] - 80, 100])
    picture[y : y + 130, x : x + 50] = rng.integers(0, 255, 3)
    bands = 1.0 + 0.1 * np.sin(np.arange(SIZE[1]) / 30.0 + rng.uniform(0.0, 6.0))
    picture *= light * bands[:, None, None]
    noise = rng.normal(0.0, 2.0, picture.shape)
    return np.asarray(np.clip(picture + noise, 0.0, 255.0), dtype=np.uint8)


def shaken(
    rng: np.random.Generator, sigma: float, count: int = 32
) -> tuple[list[ndarray], ndarray]:
    room = scene(rng)
    moved = rng.normal(0.0, 1.0, (count, 3)) * [sigma, sigma, 0.001 * sigma]
    lights = rng.uniform(0.7, 1.3, count)
    return [taken(room, *each) for each in zip(moved, [rng] * count, lights, strict=True)]
