"""Pictures of a scene, step by step, for every camera; threads share the steps."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import TypeVar

import numpy as np
from jaxtyping import Float, UInt8
from numpy import ndarray
from scipy.ndimage import gaussian_filter

from tracker.camera import Camera
from tracker.sequences.rendering.cast.people import Body
from tracker.sequences.rendering.raster import (
    Backdrop,
    Figures,
    Mesh,
    Placed,
    Sensor,
    Skeleton,
    Surface,
    draw,
    floor_shadows,
    place_bodies,
)
from tracker.sequences.rendering.rooms import CAMERAS, TARGET_HALF_EXTENTS, RoomSpec
from tracker.sequences.rendering.scene import Figure, Scene, script, shadow_balls
from tracker.sequences.rendering.walls.background import (
    AMBIENT,
    FINE,
    Background,
    Tracer,
    lamp_table,
    render_background,
)
from tracker.sequences.rendering.walls.interior import LEFT, NEAR, Interior, furnish

Result = TypeVar("Result")

BATCH = 20
"""Steps drawn by one thread at a time."""
_CELL = 0.04
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


@lru_cache(maxsize=len(CAMERAS))
def _empty_room(spec: RoomSpec, camera: Camera) -> Background:
    """The traced room, kept for the next rendering with another seed."""
    interior = furnish(spec.decor, spec.back_door, spec.front_door)
    background = render_background(Tracer(interior), camera)
    return replace(background, room=_muted(background.room), room_fine=_muted(background.room_fine))


class Studio:
    """A room lit and traced for some cameras, ready to draw any of its steps."""

    def __init__(self, spec: RoomSpec, cameras: Sequence[Camera], seed: int) -> None:
        self.scene: Scene = script(spec)
        self.cameras = tuple(cameras)
        self.seed = seed
        interior = furnish(spec.decor, spec.back_door, spec.front_door)
        with ThreadPoolExecutor(max_workers=2) as pool:
            self.backgrounds = list(pool.map(partial(_empty_room, spec), self.cameras))
        self._lamps = lamp_table(interior)
        self._shade_lamps = _shade_lamps(interior)
        self._origin = np.array([LEFT - 0.5, NEAR - 0.2])
        self._grid = (190, 160)
        self._floor_points = [
            np.nan_to_num((b.floor - self._origin) / _CELL, nan=-1.0).astype(np.float32)
            for b in self.backgrounds
        ]
        bodies = [f.body for f in self.scene.figures] + [d.body for d in self.scene.leaves]
        sizes = np.cumsum([0] + [len(b.vertices) for b in bodies])
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
            np.stack([sizes[:-1], sizes[1:]], axis=1),
            _muted(texture),
        )
        rng = np.random.default_rng([seed, 1])
        # neighbouring pixels share some noise, as after a camera's own interpolation
        width, height = np.max([camera.image_size for camera in self.cameras], axis=0)
        grain = rng.standard_normal((height + _SPARE, width + _SPARE, 3))
        grain = gaussian_filter(grain, (0.65, 0.65, 0.4), mode="wrap")
        self._grain = (grain / grain.std()).astype(np.float32)
        self._curve = _tone_curve()
        self._vignettes = [_vignette(camera) for camera in self.cameras]

    def draw(self, first: int, last: int) -> Drawn:
        """The steps ``first … last - 1`` of all cameras."""
        steps = slice(first, last)
        scene = self.scene
        worlds, lights, present = [], [], []
        for figure in scene.figures:
            placed = self._place(figure, steps)
            worlds.append(placed.world)
            lights.append(placed.light)
            present.append(figure.drawn[steps])
        for door in scene.leaves:
            angle = door.angle[steps]
            c, s, zero, one = np.cos(angle), np.sin(angle), 0.0 * angle, 1.0 + 0.0 * angle
            turned = np.stack([c, -s, zero, s, c, zero, zero, zero, one], axis=1)
            bones = Skeleton(
                np.zeros((1, 3)),
                np.ascontiguousarray(turned.reshape(-1, 1, 3, 3)),
                np.tile(door.hinge, (last - first, 1, 1)),
            )
            placed = place_bodies(_surface(door.body), bones, self._lamps, AMBIENT)
            worlds.append(placed.world)
            lights.append(placed.light)
            present.append(np.ones(last - first, dtype=bool))
        world = np.concatenate(worlds, axis=1)
        light = np.concatenate(lights, axis=1)
        balls = np.concatenate([shadow_balls(f, steps) for f in scene.figures], axis=1)
        shadows = floor_shadows(balls, self._shade_lamps, *self._grid, self._origin, _CELL)
        pictures, visible = [], []
        for number in range(len(self.cameras)):
            frames, seen = self._view(number, steps, world, light, present, shadows)
            pictures.append(frames)
            visible.append(seen)
        return Drawn(first, tuple(pictures), np.stack(visible, axis=2))

    def _place(self, figure: Figure, steps: slice) -> Placed:
        bones = Skeleton(
            figure.rest,
            np.ascontiguousarray(figure.poses.rotations[steps]),
            np.ascontiguousarray(figure.poses.joints[steps]),
        )
        return place_bodies(_surface(figure.body), bones, self._lamps, AMBIENT)

    def _view(
        self,
        number: int,
        steps: slice,
        world: ndarray,
        light: ndarray,
        present: list[ndarray],
        shadows: ndarray,
    ) -> tuple[ndarray, ndarray]:
        camera, background = self.cameras[number], self.backgrounds[number]
        flat = world.reshape(-1, 3)
        pixels, _ = camera.project(flat)
        depth = np.einsum("ni,i->n", flat, camera.rotation[2]) + camera.translation[2]
        points = np.column_stack([(pixels + 0.5) * FINE - 0.5, depth]).astype(np.float32)
        boxes, shares = [], []
        for figure in self.scene.figures:
            box, _ = camera.project_boxes(figure.centres[steps], TARGET_HALF_EXTENTS)
            corners = np.concatenate([box[:, :2], box[:, :2] + box[:, 2:]], axis=1)
            boxes.append((corners + 0.5) * FINE - 0.5)
            limit = np.array(camera.image_size) - 0.5
            cut = np.clip(corners.reshape(-1, 2, 2), -0.5, limit)
            with np.errstate(invalid="ignore"):
                shares.append(np.prod(cut[:, 1] - cut[:, 0], axis=1) / np.prod(box[:, 2:], axis=1))
        offsets = np.stack(
            [
                np.random.default_rng([self.seed, number, step]).integers(0, _SPARE, size=2)
                for step in range(steps.start, steps.stop)
            ]
        )
        shots = draw(
            Figures(
                points.reshape(*world.shape),
                light,
                np.stack(present, axis=1),
                np.stack(boxes, axis=1),
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
            Sensor(self._curve, self._grain, offsets),
        )
        counts = shots.counts
        inside = np.nan_to_num(np.stack(shares, axis=1))
        return shots.pictures, inside * counts[:, :, 1] / np.maximum(counts[:, :, 0], 1)


def _surface(body: Body) -> Surface:
    return Surface(body.vertices, body.normals, body.bones, body.shares, body.openness)


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
