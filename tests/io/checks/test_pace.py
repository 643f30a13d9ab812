"""How fast people walk tells how many steps a second there are, where no file says it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy import ndarray

from tests.io.read.recorded import detections, settled_of, toml
from tests.io.read.rig import HALF_EXTENTS, boxes, cameras
from tracker.geometry.consistency.observed import rays_of
from tracker.geometry.consistency.pace import WALKING, pace
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
