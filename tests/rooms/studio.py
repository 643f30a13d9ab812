"""Pictures of a scene, step by step, for every camera; threads share the steps."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import TypeVar

import numpy as np
from jaxtyping import Bool, Float, UInt8
from numpy import ndarray
from scipy.ndimage import gaussian_filter

from tests.rooms.lighting import floor_shadows
from tests.rooms.raster import Backdrop, Figures, Mesh, Sensor, draw
from tests.rooms.rooms import TARGET_HALF_EXTENTS, RoomSpec
from tests.rooms.scene import Scene, script, shadow_balls
from tests.rooms.walls.background import FINE, Background, Tracer, lamp_table, render_background
from tests.rooms.walls.interior import LEFT, NEAR, Interior, furnish
from tracker.geometry.camera import Camera

Result = TypeVar("Result")

BATCH = 20
"""Steps drawn by one thread at a time."""
CELL = 0.04
"""Metres: the grid of shadows on the floor."""
_SPARE = 128
"""Rows and columns of noise more than a picture has."""
_EXPOSURE = 2.25


@dataclass(frozen=True, slots=True, eq=False)
class Drawn:
    """A few steps of all cameras."""

    first: int
    pictures: tuple[UInt8[ndarray, "F h w 3"], ...]
    """For each camera, blue-green-red."""
    visible: Float[ndarray, "F P C"]
    """Share of each person's silhouette within its target box that each camera sees."""
    boxes: Float[ndarray, "F P C 4"]
    """Left, top, right, bottom of those boxes in pixels, not cut at the picture's border; NaN
    where a person is not before the camera."""


@dataclass(frozen=True, slots=True, eq=False)
class Stage:
    """A room with everything that moves in it, before any camera."""

    scene: Scene
    interior: Interior
    shade_lamps: Float[ndarray, "L 4"]
    """The lamps that throw shadows on the floor: position, and share of the floor's light."""
    origin: Float[ndarray, " 2"]
    """x and y of the first cell of the floor's grid of shadows, metres."""
    grid: tuple[int, int]
    """Its rows and columns, of ``CELL`` metres."""
    half_extents: Float[ndarray, " 3"] | None
    """Of the target box around each person's centre; None where the box is the silhouette's."""
    parts: tuple[Bool[ndarray, " V"], ...] = ()
    """For each person which vertices the silhouette's box must hold, where it is that."""


def stage_of(spec: RoomSpec) -> Stage:
    """A built-in room."""
    interior = furnish(spec.decor, spec.back_door, spec.front_door)
    origin = np.array([LEFT - 0.5, NEAR - 0.2])
    return Stage(
        script(spec), interior, _shade_lamps(interior), origin, (190, 160), TARGET_HALF_EXTENTS
    )


@cache
def _empty_room(spec: RoomSpec, camera: Camera) -> Background:
    """The traced room, kept for the next rendering: nine of 10 MB at the most."""
    interior = furnish(spec.decor, spec.back_door, spec.front_door)
    return muted_room(render_background(Tracer(interior), camera))


def muted_room(background: Background) -> Background:
    """A traced room in the colours of a plain camera."""
    return replace(background, room=_muted(background.room), room_fine=_muted(background.room_fine))


def studio_of(spec: RoomSpec, cameras: Sequence[Camera], seed: int) -> Studio:
    """A built-in room before some cameras."""
    with ThreadPoolExecutor(max_workers=2) as pool:
        backgrounds = list(pool.map(partial(_empty_room, spec), cameras))
    return Studio(stage_of(spec), cameras, backgrounds, seed)


class Studio:
    """A room lit and traced for some cameras, ready to draw any of its steps.

    Args:
        stage: What is to be seen.
        cameras: From where.
        backgrounds: The empty room before each camera.
        seed: Of the sensors' noise.
        grains: Strength of each camera's noise, 1 for a plain camera in good light.
        gains: For each camera the factors on the light by step, row and colour; none by default.
    """

    def __init__(
        self,
        stage: Stage,
        cameras: Sequence[Camera],
        backgrounds: Sequence[Background],
        seed: int,
        *,
        grains: Sequence[float] | None = None,
        gains: Sequence[Float[ndarray, "F h 3"]] | None = None,
    ) -> None:
        self.stage = stage
        self.scene: Scene = stage.scene
        self.cameras = tuple(cameras)
        self.seed = seed
        self.backgrounds = list(backgrounds)
        self._lamps = lamp_table(stage.interior)
        self._gains = gains
        self._floor_points = [
            np.nan_to_num((b.floor - stage.origin) / CELL, nan=-1.0).astype(np.float32)
            for b in self.backgrounds
        ]
        bodies = [f.body for f in self.scene.figures] + [t.body for t in self.scene.things]
        sizes = np.cumsum([0] + [len(b.vertices) for b in bodies])
        self._ranges = np.stack([sizes[:-1], sizes[1:]], axis=1)
        width = max(b.texture.shape[1] for b in bodies)
        tops = np.cumsum([0] + [b.texture.shape[0] for b in bodies])
        texture = np.zeros((int(tops[-1]), width, 3), dtype=np.float32)
        points = []
        for body, top in zip(bodies, tops[:-1], strict=True):
            rows, columns = body.texture.shape[:2]
            texture[top : top + rows, :columns] = body.texture
            points.append(body.texture_points + np.array([0.0, float(top)]))
        self._mesh = Mesh(
            np.concatenate(points).astype(np.float32),
            np.concatenate(
                [b.triangles + start for b, start in zip(bodies, sizes[:-1], strict=True)]
            ),
            np.repeat(np.arange(len(bodies), dtype=np.int32), [len(b.triangles) for b in bodies]),
            self._ranges,
            _muted(texture),
        )
        rng = np.random.default_rng([seed, 1])
        # neighbouring pixels share some noise, as after a camera's own interpolation
        width, height = np.max([camera.image_size for camera in self.cameras], axis=0)
        grain = rng.standard_normal((height + _SPARE, width + _SPARE, 3))
        grain = gaussian_filter(grain, (0.65, 0.65, 0.4), mode="wrap")
        self._grain = (grain / grain.std()).astype(np.float32)
        self._grains = [1.0] * len(self.cameras) if grains is None else list(grains)
        self._curve = _tone_curve()
        self._vignettes = [_vignette(camera) for camera in self.cameras]

    def draw(self, first: int, last: int) -> Drawn:
        """The steps ``first … last - 1`` of all cameras."""
        steps = slice(first, last)
        scene = self.scene
        worlds, lights, present = [], [], []
        for figure in scene.figures:
            placed = figure.placed(steps, self._lamps)
            worlds.append(placed.world)
            lights.append(placed.light)
            present.append(figure.drawn[steps])
        for thing in scene.things:
            placed = thing.placed(steps, self._lamps)
            worlds.append(placed.world)
            lights.append(placed.light)
            present.append(thing.drawn(steps))
        world = np.concatenate(worlds, axis=1)
        light = np.concatenate(lights, axis=1)
        balls = np.concatenate([shadow_balls(f, steps) for f in scene.figures], axis=1)
        stage = self.stage
        shadows = floor_shadows(balls, stage.shade_lamps, *stage.grid, stage.origin, CELL)
        pictures, visible, boxes = [], [], []
        for number in range(len(self.cameras)):
            frames, seen, around = self._view(number, steps, world, light, present, shadows)
            pictures.append(frames)
            visible.append(seen)
            boxes.append(around)
        return Drawn(first, tuple(pictures), np.stack(visible, axis=2), np.stack(boxes, axis=2))

    def _corners(
        self, camera: Camera, pixels: Float[ndarray, "F V 2"], steps: slice
    ) -> Float[ndarray, "F P 4"]:
        """Left, top, right and bottom of each person's box, not cut at the picture's border."""
        found = []
        for number, figure in enumerate(self.scene.figures):
            if self.stage.half_extents is not None:
                box, _ = camera.project_boxes(figure.centres[steps], self.stage.half_extents)
                found.append(np.concatenate([box[:, :2], box[:, :2] + box[:, 2:]], axis=1))
                continue
            first, last = self._ranges[number]
            own = pixels[:, first:last][:, self.stage.parts[number]]
            known = np.isfinite(own)
            low = np.where(known, own, np.inf).min(axis=1)
            high = np.where(known, own, -np.inf).max(axis=1)
            corners = np.concatenate([low, high], axis=1)
            corners[~np.isfinite(corners).all(axis=1)] = np.nan
            found.append(corners)
        return np.stack(found, axis=1)

    def _view(
        self,
        number: int,
        steps: slice,
        world: ndarray,
        light: ndarray,
        present: list[ndarray],
        shadows: ndarray,
    ) -> tuple[ndarray, ndarray, ndarray]:
        camera, background = self.cameras[number], self.backgrounds[number]
        flat = world.reshape(-1, 3)
        pixels, _ = camera.project(flat)
        depth = np.einsum("ni,i->n", flat, camera.rotation[2]) + camera.translation[2]
        points = np.column_stack([(pixels + 0.5) * FINE - 0.5, depth]).astype(np.float32)
        corners = self._corners(camera, pixels.reshape(*world.shape[:2], 2), steps)
        limit = np.array(camera.image_size) - 0.5
        cut = np.clip(corners.reshape(*corners.shape[:2], 2, 2), -0.5, limit)
        with np.errstate(invalid="ignore"):
            whole = np.prod(corners[:, :, 2:] - corners[:, :, :2], axis=2)
            shares = np.prod(cut[:, :, 1] - cut[:, :, 0], axis=2) / whole
        offsets = np.stack(
            [
                np.random.default_rng([self.seed, number, step]).integers(0, _SPARE, size=2)
                for step in range(steps.start, steps.stop)
            ]
        )
        if self._gains is None:
            gains = np.ones((steps.stop - steps.start, camera.image_size[1], 3), np.float32)
        else:
            gains = np.asarray(self._gains[number][steps], np.float32)
        shots = draw(
            Figures(
                points.reshape(*world.shape),
                light,
                np.stack(present, axis=1),
                (corners + 0.5) * FINE - 0.5,
            ),
            self._mesh,
            Backdrop(
                background.room,
                background.room_fine,
                background.depth_fine,
                self._floor_points[number],
                self._vignettes[number],
            ),
            shadows,
            Sensor(self._curve, self._grain * np.float32(self._grains[number]), offsets, gains),
        )
        counts = shots.counts
        seen = np.nan_to_num(shares) * counts[:, :, 1] / np.maximum(counts[:, :, 0], 1)
        return shots.pictures, seen, corners


def in_order(
    work: Callable[[int, int], Result], frames: int, workers: int | None = None
) -> Iterator[Result]:
    """The results of ``work(first, last)`` over all steps, in order, some ahead by threads."""
    workers = workers or min(8, os.cpu_count() or 1)
    with ThreadPoolExecutor(max_workers=workers) as pool:
        waiting: list[Future[Result]] = []
        try:
            for start in range(0, frames, BATCH):
                waiting.append(pool.submit(work, start, min(start + BATCH, frames)))
                if len(waiting) > 2 * workers:
                    yield waiting.pop(0).result()
            while waiting:
                yield waiting.pop(0).result()
        finally:
            for future in waiting:
                future.cancel()


def _shade_lamps(interior: Interior) -> ndarray:
    """The ceiling's panels as the floor sees them: position and share of its light."""
    panels = interior.lamps[:2]
    return np.array([[*lamp.centre, 0.45] for lamp in panels])


def _muted(image: ndarray) -> Float[ndarray, "H W 3"]:
    """Colours as a plain camera gives them: an eighth of the way to grey."""
    grey = np.einsum("hwc,c->hw", image, [0.2126, 0.7152, 0.0722])
    return np.asarray(image + 0.125 * (grey[..., None] - image), dtype=np.float32)


def _tone_curve() -> Float[ndarray, " K"]:
    """Picture value of light: exposure, a soft shoulder, and the sRGB curve."""
    light = np.linspace(0.0, 1.0, 4096) * _EXPOSURE
    shown = np.where(light < 0.5, light, 0.5 + 0.5 * np.tanh((light - 0.5) / 0.5))
    curved = np.where(
        shown <= 0.0031308, 12.92 * shown, 1.055 * np.maximum(shown, 1e-9) ** (1 / 2.4) - 0.055
    )
    return np.asarray(255.0 * curved, dtype=np.float32)


def _vignette(camera: Camera) -> Float[ndarray, "h w"]:
    width, height = camera.image_size
    y, x = np.mgrid[0:height, 0:width]
    cx, cy = camera.intrinsics[0, 2], camera.intrinsics[1, 2]
    squared = ((x - cx) ** 2 + (y - cy) ** 2) / (cx**2 + cy**2)
    return np.asarray(1.0 - 0.24 * squared + 0.02 * squared**2, dtype=np.float32)
