"""A small room with people walking in it, seen by cameras, as a hand-built sequence."""

from __future__ import annotations

from collections.abc import Sequence as Many
from pathlib import Path

import numpy as np
from numpy import ndarray

from tests.world import HEAD as HALF_EXTENTS
from tests.world import SMALL_CAMERAS as CAMERAS
from tests.world import SMALL_ROOM as ROOM
from tests.world import surveillance as look_at
from tracker.geometry.camera import Camera
from tracker.sequences.sequence import Detections, GroundTruth, Room, Sequence, View
from tracker.single_view.protocol import ViewResult

__all__ = ["CAMERAS", "HALF_EXTENTS", "ROOM", "crossing", "look_at", "observe",
           "sequence", "views_at", "walk"]  # fmt: skip


def walk(start: Many[float], end: Many[float], steps: int, *, sway: float = 0.0) -> ndarray:
    """A path at constant speed, with a little bow to one side: (steps, 3) metres."""
    share = np.linspace(0.0, 1.0, steps)[:, None]
    path = np.asarray(start) * (1.0 - share) + np.asarray(end) * share
    path[:, 1] += sway * np.sin(np.pi * share[:, 0])
    return path


def crossing(steps: int) -> list[tuple[int, ndarray]]:
    """Two people who come in by either door and pass each other 0.8 m apart."""
    return [
        (0, walk((-1.2, 0.0, 1.0), (1.1, 0.2, 1.05), steps, sway=0.4)),
        (0, walk((1.2, 0.0, 1.1), (-1.1, -0.2, 1.0), steps, sway=-0.4)),
    ]


def observe(
    people: Many[tuple[int, ndarray]],
    frames: int,
    cameras: Many[Camera] = CAMERAS,
    *,
    pixel_noise: float = 1.0,
    clutter_rate: float = 0.0,
    hidden: Many[tuple[int, int, range]] = (),
    seed: int = 0,
) -> list[Detections]:
    """The boxes of an outside detector.

    Args:
        people: First step and path of each.
        frames: The number of steps.
        cameras: In order.
        pixel_noise: Standard deviation of a box's place.
        clutter_rate: Expected number of false boxes a camera and step.
        hidden: Camera, person and the steps in which the one does not see the other.
        seed: Of noise and clutter.
    """
    rng = np.random.default_rng(seed)
    result = []
    for number, camera in enumerate(cameras):
        rows: list[tuple[int, ndarray]] = []
        for frame in range(frames):
            for person, (first, path) in enumerate(people):
                away = any(c == number and p == person and frame in steps for c, p, steps in hidden)
                if away or not first <= frame < first + len(path):
                    continue
                boxes, visible = camera.project_boxes(path[None, frame - first], HALF_EXTENTS)
                if visible[0]:
                    shift = np.append(rng.normal(0.0, pixel_noise, 2), [0.0, 0.0])
                    rows.append((frame, boxes[0] + shift))
            for _ in range(rng.poisson(clutter_rate)):
                place = rng.uniform([0.0, 0.0], camera.image_size)
                rows.append((frame, np.append(place - 8.0, [16.0, 16.0])))
        result.append(
            Detections(
                frames=np.array([frame for frame, _ in rows], dtype=np.int64),
                boxes=np.array([box for _, box in rows]).reshape(-1, 4),
                scores=np.ones(len(rows)),
            )
        )
    return result


def sequence(
    people: Many[tuple[int, ndarray]],
    frames: int,
    cameras: Many[Camera] = CAMERAS,
    *,
    room: Room = ROOM,
    pixel_noise: float = 1.0,
    clutter_rate: float = 0.0,
    hidden: Many[tuple[int, int, range]] = (),
    seed: int = 0,
) -> Sequence:
    """The whole as a sequence of boxes with its truth; see :func:`observe`."""
    detections = observe(
        people,
        frames,
        cameras,
        pixel_noise=pixel_noise,
        clutter_rate=clutter_rate,
        hidden=hidden,
        seed=seed,
    )
    truth = [
        (frame, person + 1, path[frame - first])
        for frame in range(frames)
        for person, (first, path) in enumerate(people)
        if first <= frame < first + len(path)
    ]
    return Sequence(
        name="synthetic",
        folder=Path(),
        fps=25.0,
        frames=frames,
        room=room,
        target_half_extents=HALF_EXTENTS,
        views=tuple(
            View(camera, detections=boxes)
            for camera, boxes in zip(cameras, detections, strict=True)
        ),
        ground_truth=GroundTruth(
            frames=np.array([row[0] for row in truth], dtype=np.int64),
            ids=np.array([row[1] for row in truth], dtype=np.int64),
            positions=np.array([row[2] for row in truth]).reshape(-1, 3),
            valid=np.ones(len(truth), dtype=bool),
        ),
        digest=f"synthetic-{seed}",
    )


def views_at(whole: Sequence, frame: int, *, sigma: float = 1.5) -> list[ViewResult]:
    """The boxes of every camera at one step, as stage 1 would hand them on."""
    results = []
    for view in whole.views:
        assert view.detections is not None
        rows = view.detections.at(frame)
        corner_boxes = view.detections.boxes[rows]
        half = corner_boxes[:, 2:] / 2.0
        boxes = np.concatenate([corner_boxes[:, :2] + half, half], axis=1)
        sigmas = np.full((len(boxes), 4), sigma)
        results.append(ViewResult.of_boxes(boxes, view.detections.scores[rows], sigmas))
    return results
