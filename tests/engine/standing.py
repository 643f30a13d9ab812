"""Standing people in a room with cameras at its corners, and the boxes a detector makes of them."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence as Many
from pathlib import Path

import numpy as np
from numpy import ndarray

from tests.engine.synthetic import look_at
from tracker.fusion import trajectories
from tracker.fusion.multi_bernoulli import MultiBernoulli
from tracker.fusion.protocol import FusionResult
from tracker.fusion.sequential_phd import SequentialPhd
from tracker.fusion.target_model import TargetModel
from tracker.fusion.trajectories import Trajectories
from tracker.geometry.camera import Camera
from tracker.parameters import DetectionBoxParams, FusionParams, RunParameters
from tracker.sequences.sequence import Entrance, GroundTruth, Room, Sequence, View
from tracker.single_view.detector_boxes import trust
from tracker.single_view.protocol import ViewResult

HALF_EXTENTS = np.array([0.3, 0.3, 0.85])
METHODS = (MultiBernoulli, SequentialPhd)
Method = type[MultiBernoulli] | type[SequentialPhd]

RECOMMENDED = FusionParams(
    measurement="box",
    motion="constant_velocity",
    birth="both",
    misses="per_person",
    occlusion=0.8,
    birth_rate=0.05,
    clutter_rate=3.0,
    room_margin=0.0,
)

DOOR = Entrance(np.array([-1.9, -1.9, 0.85]), np.array([0.3, 0.3, 0.1]))
ROOM = Room(np.array([-2.2, -2.2, 0.0]), np.array([2.2, 2.2, 2.2]), (DOOR,))

CAMERAS = tuple(
    look_at(name, place, (0.0, 0.0, 0.8), focal=620.0, image_size=(1280, 800))
    for name, place in (
        ("east", (4.6, 0.4, 2.6)),
        ("north", (0.3, 4.7, 2.7)),
        ("west", (-4.6, -0.5, 2.6)),
        ("south", (-0.4, -4.7, 2.7)),
    )
)

Hidden = Callable[[int, int, int], bool]
"""Whether a camera misses a person at a step: camera, person, step."""


def empty_room(fps: float, cameras: Many[Camera] = CAMERAS, frames: int = 0) -> Sequence:
    """The room without anybody, as a sequence without boxes."""
    none = np.zeros(0, dtype=np.int64)
    return Sequence(
        name="standing",
        folder=Path(),
        fps=fps,
        frames=frames,
        room=ROOM,
        target_half_extents=HALF_EXTENTS,
        views=tuple(View(camera) for camera in cameras),
        ground_truth=GroundTruth(none, none, np.zeros((0, 3)), none.astype(bool)),
    )


def watch(
    places: ndarray,
    cameras: Many[Camera] = CAMERAS,
    *,
    hidden: Hidden = lambda camera, person, step: False,
    miss_rate: float = 0.02,
    clutter_rate: float = 0.5,
    noise: float = 0.04,
    half_extents: ndarray = HALF_EXTENTS,
    seed: int = 0,
) -> list[tuple[ViewResult, ...]]:
    """The boxes of every camera and step, with the trust of the default parameters.

    Args:
        places: (steps, people, 3) metres; NaN where somebody is not there.
        cameras: In order.
        hidden: Who is missed besides.
        miss_rate: Of anybody, by chance.
        clutter_rate: Expected false boxes a camera and step.
        noise: Of each edge, as a share of the half height.
        half_extents: Of the people, metres.
        seed: Of all of it.
    """
    rng = np.random.default_rng(seed)
    model = TargetModel(half_extents, "box")
    steps = []
    for step, people in enumerate(places):
        views = []
        for number, camera in enumerate(cameras):
            there = np.flatnonzero(np.isfinite(people[:, 0]))
            corners = model.expected(camera, people[there]).boxes
            seen = camera.sees(people[there]) & (rng.random(len(there)) >= miss_rate)
            seen &= ~np.array([hidden(number, int(i), step) for i in there], dtype=bool)
            found = corners[seen]
            half = (found[:, 3:] - found[:, 1:2]) / 2.0
            found = found + noise * half * rng.standard_normal(found.shape)
            boxes = (
                np.concatenate([found[:, :2] + found[:, 2:], found[:, 2:] - found[:, :2]], 1) / 2
            )
            count = rng.poisson(clutter_rate)
            width, height = camera.image_size
            false = rng.uniform([0, 0, 30, 90], [width, height, 60, 180], (count, 4))
            boxes = np.concatenate([boxes, false])[rng.permutation(len(boxes) + count)]
            sigmas = trust(boxes, DetectionBoxParams())
            views.append(ViewResult.of_boxes(boxes, np.ones(len(boxes)), sigmas))
        steps.append(tuple(views))
    return steps


def fuse(
    method: Method,
    views: Many[tuple[ViewResult, ...]],
    *,
    fps: float = 10.0,
    cameras: Many[Camera] = CAMERAS,
    parameters: FusionParams = RECOMMENDED,
) -> tuple[list[FusionResult], Trajectories]:
    """The posterior of every step, and its tracks."""
    fusion = method(empty_room(fps, cameras, len(views)), RunParameters(fusion=parameters))
    state, results = fusion.start(), []
    for step in views:
        state, result = fusion.step(state, step)
        results.append(result)
    tracks = trajectories.extract(
        results,
        cameras=len(cameras),
        extraction_threshold=parameters.extraction_threshold,
        bounds=trajectories.Bounds(ROOM, parameters.room_margin, HALF_EXTENTS[2] / 2.0),
    )
    return results, tracks


def ids_of(tracks: Trajectories, path: ndarray, reach: float = 0.35) -> ndarray:
    """The id nearest to a person at each step, 0 where there is none within reach."""
    ids = np.zeros(len(path), dtype=int)
    for step, place in enumerate(path):
        rows = tracks.at(step)
        distances = np.linalg.norm(tracks.positions[rows] - place, axis=1)
        if len(distances) and distances.min() < reach:
            ids[step] = tracks.ids[rows][distances.argmin()]
    return ids


def line(points: Many[Many[float]], times: Many[float], fps: float) -> ndarray:
    """A path through points on the floor at given seconds: (steps, 3), the middle of a person."""
    steps = np.arange(round(times[-1] * fps)) / fps
    x, y = (np.interp(steps, times, [point[axis] for point in points]) for axis in range(2))
    return np.stack([x, y, np.full(len(steps), HALF_EXTENTS[2])], axis=1)
