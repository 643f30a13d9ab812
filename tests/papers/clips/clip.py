"""Rendered clips of one camera whose truth is exact: coloured ellipses in front of a wall.

The rooms of :mod:`tests.rooms` say what a method is worth in a room;
these say what it does in one picture when two who look alike meet, when one hides
another, and when the light changes. Nothing in them is estimated: where an actor
is, how large, and how much of it is seen.

A clip is drawn picture by picture (:meth:`Clip.picture`), or written as a sequence
(:func:`write`) that every single-view method takes: its one camera looks straight at a
plane in which all actors move, one centimetre a pixel.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence as Many
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float, UInt8
from numpy import ndarray
from scipy.interpolate import PchipInterpolator

from tracker.geometry.boxes import Boxes
from tracker.geometry.camera import Camera
from tracker.sequences.sequence import GroundTruth, Room, Sequence, Template, View

METRES_PER_PIXEL = 0.01
CAMERA_DISTANCE = 30.0
"""Metres: so far that a person's depth does not show."""

SPECKLE_CELLS = 12
"""An actor's clothes are patterned in so many cells across and down."""

Colour = tuple[float, float, float]
"""Blue, green, red, 0 … 255."""


@dataclass(frozen=True, slots=True, eq=False)
class Actor:
    """Somebody who moves through a clip: an upright ellipse in bands of colour."""

    name: str
    path: Float[ndarray, "T 2"]
    """Centre at each step, pixels, not rounded; NaN while it is not in the scene."""
    half_sizes: Float[ndarray, "T 2"]
    """Half width and half height at each step, pixels."""
    colours: tuple[Colour, ...]
    """From top to bottom, bands of equal height; those of two actors may be alike."""
    depth: Float[ndarray, " T"] | None = None
    """The smaller hides the larger; without, and at equal depth, later actors hide earlier."""
    speckle: float = 6.0
    """Standard deviation of the clothes' pattern, grey levels; it moves with the actor."""
    seed: int = 0
    """Of the pattern: of one seed and the same colours two actors cannot be told apart."""


@dataclass(frozen=True, slots=True, eq=False)
class Clip:
    """A clip and all that is true of it."""

    name: str
    background: Float[ndarray, "h w 3"]
    """The empty scene at full light, BGR, 0 … 255."""
    actors: tuple[Actor, ...]
    light: Float[ndarray, " T"]
    """What every pixel is multiplied by at each step."""
    noise: float = 2.0
    """Standard deviation of the sensor's noise, grey levels."""
    seed: int = 0
    """Of the noise."""
    fps: float = 25.0
    _patterns: tuple[ndarray, ...] = field(init=False)

    def __post_init__(self) -> None:
        for actor in self.actors:
            if actor.path.shape != (self.steps, 2) or actor.half_sizes.shape != (self.steps, 2):
                raise ValueError(
                    f'actor "{actor.name}" of {self.name}: expected path and half_sizes of '
                    f"{self.steps} steps as the light has, got {actor.path.shape} and "
                    f"{actor.half_sizes.shape}"
                )
        object.__setattr__(self, "_patterns", tuple(map(_pattern, self.actors)))

    @property
    def steps(self) -> int:
        """How many pictures."""
        return len(self.light)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height."""
        return self.background.shape[1], self.background.shape[0]

    def boxes(self, step: int) -> Float[ndarray, "A 4"]:
        """The true box of each actor, hidden or not: centre and half sizes, NaN where away."""
        rows = [np.append(actor.path[step], actor.half_sizes[step]) for actor in self.actors]
        boxes = np.array(rows, dtype=float).reshape(-1, 4)
        boxes[~np.isfinite(boxes).all(axis=1)] = np.nan
        return boxes

    def picture(self, step: int) -> UInt8[ndarray, "h w 3"]:
        """What the camera shows at one step, BGR."""
        return self._draw(step)[0]

    def visible(self, step: int) -> Float[ndarray, " A"]:
        """The share of each actor that is in the picture and that nobody hides; 0 where away."""
        return self._draw(step, lit=False)[1]

    def _draw(self, step: int, *, lit: bool = True) -> tuple[ndarray, Float[ndarray, " A"]]:
        picture = self.background.copy() if lit else np.zeros((1, 1, 3))
        boxes = self.boxes(step)
        seen = np.zeros((len(boxes), self.size[1], self.size[0]))
        for index in self._far_to_near(step):
            if np.isnan(boxes[index, 0]):
                continue
            left, top, cover, across, down = _ellipse(boxes[index], self.size)
            patch = np.s_[top : top + cover.shape[0], left : left + cover.shape[1]]
            seen[(slice(None), *patch)] *= 1.0 - cover
            seen[(index, *patch)] = cover
            if lit:
                colours = _colours(self.actors[index], self._patterns[index], across, down)
                picture[patch] += cover[:, :, None] * (colours - picture[patch])
        areas = np.pi * boxes[:, 2] * boxes[:, 3]
        shares = np.divide(
            seen.sum(axis=(1, 2)), areas, where=areas > 0.0, out=np.zeros(len(boxes))
        )
        if lit:
            rng = np.random.default_rng((self.seed, step))
            picture = picture * self.light[step] + self.noise * rng.standard_normal(picture.shape)
        drawn = np.clip(np.rint(picture), 0, 255).astype(np.uint8)
        return drawn, np.clip(shares, 0.0, 1.0)

    def _far_to_near(self, step: int) -> list[int]:
        depths = [0.0 if actor.depth is None else actor.depth[step] for actor in self.actors]
        return [int(i) for i in np.argsort(np.negative(depths), kind="stable")]


def _pattern(actor: Actor) -> Float[ndarray, "cells cells 3"]:
    rng = np.random.default_rng(actor.seed)
    cells = rng.normal(0.0, actor.speckle, (SPECKLE_CELLS, SPECKLE_CELLS, 1))
    return np.broadcast_to(cells, (SPECKLE_CELLS, SPECKLE_CELLS, 3)).copy()


def _ellipse(
    box: Float[ndarray, " 4"], size: tuple[int, int]
) -> tuple[int, int, ndarray, ndarray, ndarray]:
    """Left and top pixel, the share of each pixel covered, and the place in the ellipse, −1 … 1."""
    x, y, half_x, half_y = box
    left, top = (max(0, int(np.floor(value - 1.0))) for value in (x - half_x, y - half_y))
    right = min(size[0], int(np.ceil(x + half_x + 2.0)))
    bottom = min(size[1], int(np.ceil(y + half_y + 2.0)))
    across = (np.arange(left, max(left, right)) - x)[None, :] / half_x
    down = (np.arange(top, max(top, bottom)) - y)[:, None] / half_y
    radius = np.hypot(across, down)
    # the distance to the border along the gradient, in pixels: a border pixel is covered in part
    slope = np.hypot(across / half_x, down / half_y) / np.maximum(radius, 1e-9)
    cover = np.clip(0.5 + (1.0 - radius) / np.maximum(slope, 1e-9), 0.0, 1.0)
    return left, top, cover, across, down


def _colours(actor: Actor, pattern: ndarray, across: ndarray, down: ndarray) -> ndarray:
    bands = np.array(actor.colours)
    band = np.clip(((down + 1.0) / 2.0 * len(bands)).astype(int), 0, len(bands) - 1)
    column = np.clip(((across + 1.0) / 2.0 * SPECKLE_CELLS).astype(int), 0, SPECKLE_CELLS - 1)
    row = np.clip(((down + 1.0) / 2.0 * SPECKLE_CELLS).astype(int), 0, SPECKLE_CELLS - 1)
    colours: ndarray = bands[band] + pattern[row, column]
    return colours


def wall(
    size: tuple[int, int], *, seed: int = 0, contrast: float = 60.0
) -> Float[ndarray, "h w 3"]:
    """An empty scene: a lit wall with things on it and a texture.

    Args:
        size: Width and height in pixels.
        seed: Which wall.
        contrast: How far the things' grey levels are from the wall's, at most.
    """
    rng = np.random.default_rng(seed)
    width, height = size
    ramp = np.linspace(150.0, 185.0, width)[None, :, None] * np.array([0.97, 1.0, 1.03])
    scene = np.broadcast_to(ramp, (height, width, 3)).copy()
    for _ in range(14):
        x, y = rng.integers(0, width), rng.integers(0, height)
        w, h = rng.integers(width // 16, width // 5), rng.integers(height // 16, height // 4)
        grey = rng.uniform(-contrast, contrast)
        scene[y : y + h, x : x + w] = 165.0 + grey + rng.normal(0.0, 6.0, 3)
    fine = cv2.GaussianBlur(rng.normal(0.0, 12.0, (height, width, 1)), (0, 0), 1.2)
    scene = cv2.GaussianBlur(scene, (0, 0), 0.8) + fine.reshape(height, width, 1)
    return np.asarray(np.clip(scene, 0.0, 255.0))


def through(
    steps: int,
    points: Many[tuple[float, float, float]],
    *,
    sway: float = 0.0,
    seed: int = 0,
) -> Float[ndarray, "T 2"]:
    """A smooth path through (step, x, y); NaN before the first point and after the last.

    Args:
        steps: Of the clip.
        points: Steps ascending, pixels.
        sway: How far the path strays from that, pixels: irregular, but smooth.
        seed: Of the straying.
    """
    table = np.array(points, dtype=float)
    path = np.full((steps, 2), np.nan)
    here = np.arange(steps)
    here = here[(here >= table[0, 0]) & (here <= table[-1, 0])]
    path[here] = PchipInterpolator(table[:, 0], table[:, 1:], axis=0)(here)
    rng = np.random.default_rng(seed)
    periods = rng.uniform(18.0, 70.0, (5, 1, 2))
    waves = np.sin(2.0 * np.pi * (here[None, :, None] / periods + rng.random((5, 1, 2))))
    path[here] += sway * waves.mean(axis=0)
    return path


def constant_size(steps: int, half_width: float, half_height: float) -> Float[ndarray, "T 2"]:
    """The same half sizes at every step."""
    return np.tile([half_width, half_height], (steps, 1)).astype(float)


def write(clip: Clip, folder: Path) -> Sequence:
    """The clip as a sequence of one camera, its pictures as lossless images.

    Everybody moves in the plane y = 0, one centimetre a pixel. Each actor has a template
    of its own, of the first step at which nothing of it is hidden.

    Args:
        clip: Its pictures are drawn now.
        folder: Made where it is not there; gets one image a step.

    Raises:
        OSError: If an image cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    images = []
    digest = hashlib.sha256(clip.name.encode())
    for step in range(clip.steps):
        images.append(folder / f"{step:05d}.png")
        picture = clip.picture(step)
        digest.update(picture.tobytes())
        if not cv2.imwrite(str(images[-1]), picture, [cv2.IMWRITE_PNG_COMPRESSION, 1]):
            raise OSError(f"{images[-1]}: the image cannot be written")
    width, height = clip.size
    half = np.nanmean(np.concatenate([a.half_sizes for a in clip.actors]), axis=0)
    half_x, half_z = (half * METRES_PER_PIXEL).tolist()
    camera = plane_camera(clip.size)
    frames, ids, positions = [], [], []
    for step in range(clip.steps):
        for index, box in enumerate(clip.boxes(step)):
            if np.isfinite(box).all():
                frames.append(step)
                ids.append(index + 1)
                positions.append([box[0], 0.0, height - box[1]])
    return Sequence(
        name=clip.name,
        folder=folder,
        fps=clip.fps,
        frames=clip.steps,
        room=Room(
            np.array([0.0, -half_x, 0.0]),
            np.array([width * METRES_PER_PIXEL, half_x, height * METRES_PER_PIXEL]),
        ),
        target_half_extents=np.array([half_x, half_x, half_z]),
        views=(View(camera, images=tuple(images)),),
        templates=tuple(_templates(clip, camera.name)),
        ground_truth=GroundTruth(
            np.array(frames, dtype=np.int64),
            np.array(ids, dtype=np.int64),
            np.array(positions, dtype=float).reshape(-1, 3) * METRES_PER_PIXEL,
            np.ones(len(frames), dtype=bool),
        ),
        digest=digest.hexdigest()[:16],
    )


def plane_camera(size: tuple[int, int]) -> Camera:
    """A camera that draws (x, 0, z) metres at x / 0.01 pixels from the left, upright."""
    width, height = size
    focal = CAMERA_DISTANCE / METRES_PER_PIXEL
    intrinsics = np.array([[focal, 0.0, width / 2], [0.0, focal, height / 2], [0.0, 0.0, 1.0]])
    rotation = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    middle = np.array([width / 2, 0.0, height / 2]) * METRES_PER_PIXEL
    place = middle - [0.0, CAMERA_DISTANCE, 0.0]
    return Camera("clip", size, intrinsics, rotation, -rotation @ place, np.zeros(5))


def _templates(clip: Clip, camera: str) -> list[Template]:
    templates: dict[int, Template] = {}
    for step in range(clip.steps):
        if len(templates) == len(clip.actors):
            break
        shares, boxes = clip.visible(step), Boxes(clip.boxes(step)).left_top
        for index in np.flatnonzero(shares > 0.98).tolist():
            name = clip.actors[index].name
            templates.setdefault(index, Template(name, camera, step, boxes[index]))
    return [templates[index] for index in sorted(templates)]
