"""A wall with furniture as a camera of its own exposure and noise sees it, and somebody in it."""

from __future__ import annotations

import cv2
import numpy as np
from numpy import ndarray

SKIN = (30.0, 60.0, 170.0)


def empty_room(height: int = 96, width: int = 128) -> ndarray:
    """Walls from dark to light with a few pieces of furniture."""
    rng = np.random.default_rng(0)
    ramp = np.linspace(40, 210, width)[None, :, None] * np.array([0.9, 1.0, 1.05])
    room = np.broadcast_to(ramp, (height, width, 3)).copy()
    for _ in range(12):
        x, y = rng.integers(0, width - 30), rng.integers(0, height - 30)
        room[y : y + 25, x : x + 20] = rng.uniform(20, 230, 3)
    return cv2.GaussianBlur(room, (0, 0), 1.0)


def photograph(room: ndarray, gain: float = 1.0, noise: float = 1.5, seed: int = 0) -> ndarray:
    """The room as a camera with noise and its own exposure shows it."""
    seen = room * gain + np.random.default_rng(seed).normal(0.0, noise, room.shape)
    return np.clip(np.rint(seen), 0, 255).astype(np.uint8)


def with_person(room: ndarray, x: int, y: int = 30) -> ndarray:
    """Somebody in front of it."""
    peopled = room.copy()
    cv2.ellipse(peopled, (x, y), (9, 14), 0, 0, 360, SKIN, -1)
    return peopled


def person_mask(x: int, y: int = 30) -> ndarray:
    """Where that person is, as truth values."""
    return with_person(np.zeros_like(empty_room()), x, y).any(axis=2)


def clip(gains: ndarray) -> list[ndarray]:
    """Somebody walks through the picture; no picture is empty."""
    room = empty_room()
    return [photograph(with_person(room, 10 + 4 * k), gain, seed=k) for k, gain in enumerate(gains)]
