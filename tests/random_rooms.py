"""Random rooms, cameras and walkers, and the boxes that a detector would draw around them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy import ndarray

from tracker.geometry.camera import Camera
from tracker.sequences.sequence import Detections, GroundTruth, Room, Sequence, View


@dataclass(frozen=True)
class Walkers:
    """People who walk from place to place: where each is at any time."""

    places: ndarray
    """(P, W, 2), metres."""
    times: ndarray
    """(P, W), seconds, ascending: when each is at each place."""
    heights: ndarray
    """(P,), metres."""

    def at(self, time: float) -> ndarray:
        """(P, 3) middles of all at one time."""
        floor = np.array(
            [
                [np.interp(time, times, places[:, axis]) for axis in range(2)]
                for places, times in zip(self.places, self.times, strict=True)
            ]
        )
        return np.column_stack([floor, self.heights / 2.0])


def looking_camera(
    name: str, centre: ndarray, target: ndarray, focal: float, size: tuple[int, int]
) -> Camera:
    """A camera at a place that looks at another one, upright."""
    ahead = (target - centre) / np.linalg.norm(target - centre)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(ahead, right), ahead])
    width, height = size
    intrinsics = np.array(
        [[focal, 0.0, (width - 1) / 2], [0.0, focal, (height - 1) / 2], [0.0, 0.0, 1.0]]
    )
    return Camera(name, size, intrinsics, rotation, -rotation @ centre, np.zeros(5))


def random_walkers(
    rng: np.random.Generator, room: Room, people: int, seconds: float, height: float = 1.7
) -> Walkers:
    """People who walk at 0.7 to 1.5 m/s, with short stops, all the time."""
    count = int(seconds) + 40
    low, high = room.minimum[:2] + 0.4, room.maximum[:2] - 0.4
    places = rng.uniform(low, high, (people, count, 2))
    ways = np.linalg.norm(np.diff(places, axis=1), axis=2)
    lasting = ways / rng.uniform(0.7, 1.5, ways.shape) + rng.uniform(0.0, 0.5, ways.shape)
    times = np.concatenate([np.zeros((people, 1)), np.cumsum(lasting, axis=1)], axis=1)
    times -= rng.uniform(30.0, 35.0, (people, 1))
    return Walkers(places, times, height * rng.uniform(0.92, 1.08, people))


def boxes_of(
    rng: np.random.Generator,
    camera: Camera,
    middles: ndarray,
    heights: ndarray,
    *,
    noise: float = 0.03,
    misses: float = 0.08,
    clutter: float = 0.3,
) -> ndarray:
    """(N, 4) left, top, width, height that a detector draws; cut off at the picture's edge."""
    rows = []
    width, height = camera.image_size
    for middle, tall in zip(middles, heights, strict=True):
        half = np.array([0.18 * tall, 0.18 * tall, tall / 2.0])
        ends, valid = camera.project(middle + np.outer([half[2], -half[2]], [0.0, 0.0, 1.0]))
        if not valid.all() or rng.random() < misses:
            continue
        (above, top), (below, bottom) = ends
        x = (above + below) / 2.0
        across = 0.36 * (bottom - top)
        corners = np.array([x - across / 2, top, x + across / 2, bottom])
        corners += noise * (bottom - top) * rng.standard_normal(4)
        corners = np.clip(corners, -0.5, [width - 0.5, height - 0.5] * 2)
        if (corners[2:] - corners[:2] > 4.0).all():
            rows.append([*corners[:2], *(corners[2:] - corners[:2])])
    for _ in range(rng.poisson(clutter)):
        tall = rng.uniform(0.1, 0.4) * height
        place = rng.uniform([0.0, 0.0], [width - 0.4 * tall, height - tall])
        rows.append([*place, 0.36 * tall, tall])
    return np.array(rows, dtype=float).reshape(-1, 4)


def random_room(
    seed: int,
    *,
    cameras: int | None = None,
    people: int | None = None,
    fps: float = 12.0,
    steps: int = 240,
    late: tuple[float, ...] = (),
    height: float = 1.7,
    noise: float = 0.03,
) -> Sequence:
    """A room of 4 to 10 m with cameras around it and people who walk in it.

    Args:
        seed: Another room for each.
        cameras: Two to five where it is not given.
        people: One to six where it is not given.
        fps: Steps a second.
        steps: Their number.
        late: Seconds by which each camera shows what happened before; 0 for the others.
        height: Of people, metres.
        noise: Standard deviation of the edges of boxes, box heights.
    """
    rng = np.random.default_rng(seed)
    sides = rng.uniform(4.0, 10.0, 2)
    room = Room(np.array([0.0, 0.0, 0.0]), np.array([*sides, 2.2]))
    middle = np.array([*(sides / 2.0), 0.9])
    cameras = int(rng.integers(2, 6)) if cameras is None else cameras
    people = int(rng.integers(1, 7)) if people is None else people
    first = rng.uniform(0.0, 2.0 * np.pi)
    views = []
    walkers = random_walkers(rng, room, people, steps / fps, height)
    for number in range(cameras):
        # apart from each other, and not on a line
        angle = first + 2.0 * np.pi * (number + rng.uniform(-0.15, 0.15)) / max(cameras, 3)
        away = 0.5 * np.linalg.norm(sides) + rng.uniform(0.5, 2.5)
        place = middle + np.array(
            [away * np.cos(angle), away * np.sin(angle), rng.uniform(1.0, 2.6)]
        )
        size = (int(rng.choice([640, 1280, 1920])), int(rng.choice([480, 720, 1080])))
        focal = rng.uniform(0.5, 0.7) * size[0]
        aim = middle + rng.uniform(-0.5, 0.5, 3)
        camera = looking_camera(f"cam{number + 1}", place, aim, focal, size)
        delay = late[number] if number < len(late) else 0.0
        frames, boxes = [], []
        for step in range(steps):
            at = walkers.at(step / fps - delay)
            found = boxes_of(rng, camera, at, walkers.heights, noise=noise)
            frames += [step] * len(found)
            boxes.append(found)
        detections = Detections(
            np.array(frames, dtype=np.int64), np.concatenate(boxes), np.ones(len(frames))
        )
        views.append(View(camera, detections=detections))
    truth = np.concatenate([walkers.at(step / fps) for step in range(steps)])
    return Sequence(
        name=f"random room {seed}",
        folder=Path(),
        fps=fps,
        frames=steps,
        room=room,
        target_half_extents=np.array([0.18 * height, 0.18 * height, height / 2.0]),
        views=tuple(views),
        ground_truth=GroundTruth(
            np.repeat(np.arange(steps), people),
            np.tile(np.arange(1, people + 1), steps),
            truth,
            np.ones(steps * people, dtype=bool),
        ),
        digest=f"random-{seed}-{fps}-{steps}-{noise}",
    )


def with_boxes(sequence: Sequence, change: dict[int, Detections]) -> Sequence:
    """The same with other boxes in some cameras."""
    views = [
        replace(view, detections=change.get(index, view.detections))
        for index, view in enumerate(sequence.views)
    ]
    return replace(sequence, views=tuple(views))
