"""How fast people walk tells how many steps a second there are, where no file says it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy import ndarray

from tests.io.read.recorded import detections, settled_of, toml
from tests.io.read.rig import HALF_EXTENTS, boxes, cameras
from tests.random_rooms import random_room
from tracker.geometry.consistency.observed import rays_of
from tracker.geometry.consistency.pace import WALKING, pace
from tracker.io.importing.finding.people import PERSON, paced, resized
from tracker.io.importing.finding.times import USUAL_RATE


def walkers(fps: float, speed: float, steps: int = 200) -> ndarray:
    """Three people who walk round in circles of 2 m, each a metre of height above the floor."""
    turned = np.arange(steps)[:, None] * speed / (2.0 * fps) + np.array([0.0, 2.1, 4.2])
    round_ = [2.0 * np.cos(turned), 2.0 * np.sin(turned), np.full_like(turned, HALF_EXTENTS[2])]
    return np.stack(round_, axis=-1)


def pace_of(places: ndarray, noise: float = 2.0) -> float | None:
    rng = np.random.default_rng(3)
    rays = []
    for camera in cameras():
        frames, found = boxes(camera, places)
        rays.append(rays_of(frames, found + rng.normal(0.0, noise, found.shape), camera))
    return pace(cameras(), rays)


@pytest.mark.parametrize("fps", [1.0, 2.0, 4.0, 10.0, 25.0])
def test_of_people_who_walk(fps: float) -> None:
    found = pace_of(walkers(fps, WALKING))
    assert found is not None
    assert WALKING / found == pytest.approx(fps, rel=0.25)


@pytest.mark.parametrize(("steps", "enough"), [(11, True), (10, False)])
def test_thirty_displacements_are_enough(steps: int, enough: bool) -> None:
    """Three people in so many steps have three less from one step to the next."""
    assert (pace_of(walkers(1.0, WALKING, steps)) is not None) is enough


def test_nobody_walks() -> None:
    assert pace_of(walkers(4.0, 0.0)) is None
    assert pace(cameras(), [rays_of(np.zeros(0), np.zeros((0, 4)), c) for c in cameras()]) is None


def test_it_is_told_and_taken(tmp_path: Path) -> None:
    toml(tmp_path)
    detections(tmp_path, places=walkers(2.0, WALKING))
    settled = settled_of(tmp_path)
    assert settled.fps == 2.0
    assert "from step to step" in dict(settled.found)["fps"]


def test_a_rate_that_the_times_of_boxes_state_is_told(tmp_path: Path) -> None:
    toml(tmp_path)
    detections(tmp_path, places=walkers(2.0, WALKING))
    for path in tmp_path.glob("cam*.csv"):
        head, *rows = path.read_text().splitlines()
        cells = [row.partition(",") for row in rows]
        timed = [f"{int(frame) / 2.0},{rest}" for frame, _, rest in cells]
        path.write_text("\n".join([f"time,{head.partition(',')[2]}", *timed]) + "\n")
    settled = settled_of(tmp_path)
    assert settled.fps == 2.0
    assert dict(settled.found)["fps"] == "2, by the files of boxes or truth; --fps"


def test_who_goes_little_may_be_slow(tmp_path: Path) -> None:
    toml(tmp_path)
    detections(tmp_path, places=walkers(USUAL_RATE, 0.5))
    settled = settled_of(tmp_path)
    assert settled.fps == USUAL_RATE
    assert dict(settled.found)["fps"].startswith("25, as usual")


@pytest.mark.full
@pytest.mark.parametrize("seed", [21, 22, 23])
@pytest.mark.parametrize(("height", "factor"), [(1.7, 1.0), (0.72, 0.7 / 1.7), (0.25, 0.25 / 1.7)])
def test_who_would_run_is_smaller(seed: int, height: float, factor: float) -> None:
    room = random_room(seed, cameras=4, people=3, height=height)
    taken = resized(room.cameras, PERSON / height)
    found, why = paced(taken, [view.detections for view in room.views], room.fps)
    assert found == pytest.approx(factor)
    assert "walk" in why


def test_who_does_not_walk_leaves_it_open() -> None:
    room = random_room(21, cameras=4, people=3, height=0.72, steps=60)
    still = [view.detections for view in room.views]
    assert all(own is not None for own in still)
    found, why = paced(room.cameras, still, 0.5)  # as slow as that
    assert found == 1.0
    assert "--unit" not in why
    assert "where they sit" in why


def test_a_world_twice_as_large_has_cameras_twice_as_far_apart() -> None:
    cameras = random_room(21, cameras=2).cameras
    for one, other in zip(cameras, resized(cameras, 2.0), strict=True):
        np.testing.assert_allclose(other.centre, 2.0 * one.centre)
