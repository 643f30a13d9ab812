"""What holds for both fusion methods: pure steps, bounded states, evidence that adds up."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from numpy import ndarray
from numpy.testing import assert_allclose

from tests.engine.standing import (
    METHODS,
    RECOMMENDED,
    Method,
    empty_room,
    fuse,
    ids_of,
    line,
    watch,
)
from tracker.fusion.protocol import FusionResult
from tracker.parameters import RunParameters
from tracker.single_view.protocol import ViewResult

both_methods = pytest.mark.parametrize("method", METHODS, ids=lambda method: method.__name__)

NO_BOXES = ViewResult.of_boxes(np.zeros((0, 4)), np.zeros(0), np.zeros((0, 4)))


def three_people(steps: int = 60) -> ndarray:
    """Walking about, half a metre apart where they pass: (steps, 3, 3)."""
    seconds = steps / 10.0
    paths = [
        line([(-1.8, -1.8), (-0.5, 0.4), (-1.2, 1.0)], [0, seconds / 2, seconds], 10.0),
        line([(1.5, -1.5), (1.0, 1.2)], [0, seconds], 10.0),
        line([(0.0, 1.5), (0.3, -1.2)], [0, seconds], 10.0),
    ]
    return np.stack(paths, axis=1)


@both_methods
def test_without_boxes_there_is_nobody(method: Method) -> None:
    results, tracks = fuse(method, [(NO_BOXES,) * 4] * 8)
    assert len(tracks) == 0
    assert all(result.posterior.cardinality < 0.2 for result in results)


@both_methods
def test_clutter_alone_is_hardly_ever_somebody(method: Method) -> None:
    nobody = np.full((150, 1, 3), np.nan)
    _, tracks = fuse(method, watch(nobody, clutter_rate=3.0, seed=5))
    assert len(tracks) <= 8


@both_methods
def test_a_camera_that_fails_and_comes_back_loses_nobody(method: Method) -> None:
    places = three_people(80)
    for dead in range(4):
        views = watch(places, seed=6)
        for step in range(25, 50):
            views[step] = tuple(NO_BOXES if c == dead else v for c, v in enumerate(views[step]))
        _, tracks = fuse(method, views)
        found = [ids_of(tracks, places[:, person], 0.4)[12:] for person in range(3)]
        assert all((ids > 0).mean() > 0.97 for ids in found)
        assert len({int(ids[-1]) for ids in found}) == 3
        assert all(ids[-1] == ids[5] for ids in found)


@both_methods
def test_people_outside_the_room_are_followed_and_not_reported(method: Method) -> None:
    places = np.tile([[2.5, 0.3, 0.85], [-0.5, -0.5, 0.85]], (30, 1, 1))
    results, tracks = fuse(method, watch(places, seed=7))
    rows = tracks.at(29)
    assert len(tracks.ids[rows]) == 1
    assert_allclose(tracks.positions[rows][0], [-0.5, -0.5, 0.85], atol=0.15)
    posterior = results[29].posterior
    beyond = np.linalg.norm(posterior.means[:, :3] - places[0, 0], axis=1) < 0.3
    assert posterior.weights[beyond].max() > 0.9


def bytes_held(method: Method, steps: int, *, before: int = 0) -> list[int]:
    """Memory held by a filter that walks on and on, measured ten times.

    What it took in the steps ``before`` is not counted: counting takes five times as long as the
    steps themselves, and what grows does so at the end as well.
    """
    views = watch(three_people(100), seed=8, clutter_rate=1.0)
    fusion = method(empty_room(10.0), RunParameters(fusion=RECOMMENDED))
    state, held = fusion.start(), []
    result: FusionResult | None = None
    for step in range(before):
        state, result = fusion.step(state, views[step % len(views)])
    tracemalloc.start()
    for step in range(before, before + steps):
        state, result = fusion.step(state, views[step % len(views)])
        if (step + 1 - before) % (steps // 10) == 0:
            held.append(tracemalloc.get_traced_memory()[0])
    tracemalloc.stop()
    assert result is not None
    return held


@both_methods
def test_memory_is_flat(method: Method) -> None:
    held = bytes_held(method, 400)
    assert held[-1] < max(held[1:5]) + 100_000


@pytest.mark.long
@both_methods
def test_memory_is_flat_over_ten_thousand_steps(method: Method) -> None:
    held = bytes_held(method, 2_500, before=7_500)
    assert max(held[5:]) < max(held[:5]) + 25_000
