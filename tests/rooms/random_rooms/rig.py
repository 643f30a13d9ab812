"""The cameras of a random room: where they hang, how they are turned, and their lenses."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tests.rooms.random_rooms.choices import Choices, generator
from tracker.geometry.camera import Camera

_HEIGHTS = {"low": (1.1, 1.7), "middle": (1.8, 2.3), "high": (2.25, 3.1)}
_VIEWS = {"pinhole": (58.0, 84.0), "mild": (60.0, 88.0), "barrel": (74.0, 96.0),
          "fisheye": (105.0, 135.0)}  # fmt: skip
"""Degrees seen along the picture's longer side."""
_FROM_WALL = 0.16
LARGEST = 540
"""Lines up to which pictures are drawn at their own size; larger ones at half of it."""


def mount(choices: Choices) -> tuple[Camera, ...]:
    """The cameras, around the room and looking into it."""
    rng = generator(choices.seed, 2)
    count = choices.cameras
    start = rng.uniform(0.0, 2.0 * np.pi)
    if count == 2:
        angles = start + np.array([0.0, rng.uniform(1.1, 2.2)])
    else:
        angles = start + 2.0 * np.pi * (np.arange(count) + rng.uniform(-0.22, 0.22, count)) / count
    half = np.array([choices.width, choices.depth]) / 2.0 - _FROM_WALL
    portrait = rng.random() < 0.6
    cameras = []
    for number, angle in enumerate(angles):
        toward = np.array([math.cos(angle), math.sin(angle)])
        place = toward * float(np.min(half / np.maximum(np.abs(toward), 1e-6)))
        height = min(rng.uniform(*_HEIGHTS[choices.mounting]), choices.ceiling - 0.12)
        centre = np.array([*place, height])
        target = np.array([*(rng.uniform(-0.22, 0.22, 2) * half), rng.uniform(0.75, 1.1)])
        cameras.append(_camera(f"cam{number + 1}", choices, centre, target, portrait, rng))
    return tuple(cameras)


def _camera(
    name: str, choices: Choices, centre: ndarray, target: ndarray, portrait: bool,
    rng: np.random.Generator,
) -> Camera:  # fmt: skip
    ahead = (target - centre) / np.linalg.norm(target - centre)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    level = np.stack([right, np.cross(ahead, right), ahead])
    width, height = choices.image_size
    roll = rng.normal(0.0, math.radians(1.2))
    if choices.turned == "quarter":
        roll += math.copysign(math.pi / 2.0, rng.uniform(-1.0, 1.0))
        # a telephone held upright films turned pictures, or is itself turned in its holder
        width, height = (height, width) if portrait else (width, height)
    elif choices.turned == "upside down":
        roll += math.pi
    elif choices.turned == "slanted":
        roll += math.radians(float(rng.uniform(8.0, 28.0) * rng.choice([-1.0, 1.0])))
    c, s = math.cos(roll), math.sin(roll)
    rotation = np.round(np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) @ level, 10)
    view = math.radians(rng.uniform(*_VIEWS[choices.lens]))
    longer = max(width, height)
    fisheye = choices.lens == "fisheye"
    focal = longer / view if fisheye else longer / (2.0 * math.tan(view / 2.0))
    intrinsics = np.array(
        [
            [focal, 0.0, (width - 1) / 2.0 + rng.normal(0.0, 0.008 * width)],
            [0.0, focal * rng.uniform(0.985, 1.015), (height - 1) / 2.0 + rng.normal(0.0, 4.0)],
            [0.0, 0.0, 1.0],
        ]
    )
    return Camera(
        name,
        (width, height),
        np.round(intrinsics, 4),
        rotation,
        np.round(-rotation @ centre, 10),
        _distortion(choices, rng),
        fisheye=fisheye,
    )


def _distortion(choices: Choices, rng: np.random.Generator) -> Float[ndarray, " n"]:
    if choices.lens == "fisheye":
        return np.round([rng.uniform(-0.02, 0.03), rng.uniform(-0.008, 0.004), 0.0, 0.0], 6)
    if choices.lens == "pinhole":
        return np.zeros(5)
    strong = choices.lens == "barrel"
    first = rng.uniform(-0.24, -0.15) if strong else rng.uniform(-0.12, 0.04)
    second = 0.28 * first * first + (0.02 if strong else 0.01)
    tangential = rng.normal(0.0, 0.0006, 2)
    return np.round([first, second, *tangential, 0.0], 6)


def drawn_by(camera: Camera) -> tuple[Camera, int]:
    """The camera whose pictures are drawn, and how many times they are then enlarged."""
    width, height = camera.image_size
    if min(width, height) <= LARGEST:
        return camera, 1
    intrinsics = camera.intrinsics.copy()
    intrinsics[:2] /= 2.0
    intrinsics[:2, 2] -= 0.25  # the middle of a pixel twice as large
    return replace(camera, image_size=(width // 2, height // 2), intrinsics=intrinsics), 2
