"""Which person with templates a piece of a track is: by its boxes that nobody else's touch."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from numpy import ndarray

from tracker.kernels.kalman import Measurements
from tracker.single_view.protocol import ViewResult
from tracker.smoothing.paths import CameraBoxes, Links, Paths
from tracker.smoothing.smoother import Smoother
from tracker.smoothing.tracklets.appearance import Appearances, sum_by_chain, template_log_odds
from tracker.steps import Steps

STEP = 0.2
FIRST, SECOND = [0.9, 0.1], [0.1, 0.9]


def told(likenesses: list[list[float]], places: list[list[float]], weight: float = 1.0) -> ndarray:
    """Of one piece whose boxes a camera shows, the first of the boxes of each step."""
    steps = len(likenesses)
    boxes = np.array([[x, 50.0, 5.0, 10.0] for own in places for x in own])
    starts = np.cumsum([0, *(len(own) for own in places)])

    def nothing(*_: ndarray) -> Measurements:
        return Measurements(np.zeros((0, 3)), np.zeros((0, 3, 3)))

    camera = CameraBoxes(
        starts, np.zeros(steps, bool), boxes, np.ones_like(boxes), np.ones(len(boxes)), nothing
    )
    smoother = cast(
        Smoother, SimpleNamespace(cameras=[camera], model=SimpleNamespace(step_time=STEP))
    )
    every = np.full((len(boxes), 2), 0.5)
    every[starts[:-1]] = likenesses
    piece = Paths.of([1], [0], [np.zeros((steps, 6))], [np.zeros((steps, 6, 6))], 6)
    rows = np.arange(steps)
    links = Links(np.zeros(steps, dtype=np.int64), rows, starts[:-1].copy(), np.ones(steps))
    return template_log_odds(piece, links, smoother, Appearances(None, [every]), weight)[0]


def test_boxes_of_ones_colours_count_by_the_time_that_they_last() -> None:
    found = told([FIRST] * 10, [[50.0]] * 10)
    own, other = (10 * STEP * np.log(0.1 + 0.9 * 2.0 * p) for p in (0.9, 0.1))
    assert found == pytest.approx([0.0, other - own])
    assert told([FIRST] * 10, [[50.0]] * 10, 0.5) == pytest.approx(found / 2.0)


def test_boxes_that_look_now_like_one_and_now_like_the_other_tell_less_but_no_stranger() -> None:
    found = told([FIRST, FIRST, SECOND], [[50.0]] * 3)
    once = told([FIRST], [[50.0]])
    assert found.max() == 0.0
    assert found == pytest.approx(once)


def test_what_another_box_touches_says_nothing_of_colours() -> None:
    alone, crowded = [[50.0]] * 5, [[50.0, 56.0]] * 5
    assert told([SECOND] * 5 + [FIRST] * 5, alone + crowded) == pytest.approx(
        told([SECOND] * 5, alone)
    )


def test_a_camera_without_a_picture_is_not_asked_and_one_person_alone_tells_nothing() -> None:
    view = ViewResult.of_boxes(np.ones((1, 4)), np.ones(1), np.ones((1, 4)))
    of_two = replace(view, likenesses=np.array([FIRST]))
    seen = Appearances.of(Steps.of([(of_two, view), (view, of_two)], ViewResult, 2)).likenesses
    assert seen is not None
    assert [one.tolist() for one in seen] == [[FIRST, [0.5, 0.5]], [[0.5, 0.5], FIRST]]
    for one in (replace(view, likenesses=np.ones((1, 1))), view):
        assert Appearances.of(Steps.of([(one,)], ViewResult, 1)).likenesses is None


def test_chains_are_the_likeliest_of_all_their_pieces() -> None:
    pieces = np.array([[0.0, -6.0], [-4.0, 0.0], [0.0, 0.0]])
    assert sum_by_chain(pieces, [[0, 1], [2]]).tolist() == [[0.0, -2.0], [0.0, 0.0]]
