"""Reconstructions without a unit are as large as people who stand or walk make them."""

from __future__ import annotations

import numpy as np
import pytest

from tests.random_rooms import random_room
from tracker.io.importing.finding.people import PERSON, paced, resized


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
