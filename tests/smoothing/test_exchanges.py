"""Two who went on as each other are found by both lives as a whole, and settled."""

from __future__ import annotations

import numpy as np
import pytest
from numpy import ndarray
from scipy.optimize import linear_sum_assignment

from tests.random_rooms import random_room
from tests.smoothing.measured import STEP, fitted_to, measured
from tests.smoothing.test_positions_laws import PLAIN
from tracker import pipeline
from tracker.parameters import with_values
from tracker.pipeline import Run
from tracker.smoothing.identity.exchanges import exchange_breaks, turn
from tracker.smoothing.smoother import Fitted

SIGMA = 0.05


def fitted(places: list[ndarray]) -> Fitted:
    """Paths of people measured at some places, (T, 3) metres each."""
    paths, smooth = measured(places, SIGMA)
    as_stated = np.ones(len(paths.states))
    return fitted_to(paths, smooth(as_stated), as_stated)


def two(steps: int, turn: int) -> list[ndarray]:
    """Two who cross at right angles, each going on as the other from a step on."""
    rng = np.random.default_rng(4)
    away = (np.arange(steps) - turn + 0.5) * STEP * 1.2
    one = np.stack([away, np.zeros(steps), np.ones(steps)], axis=1)
    other = np.stack([np.full(steps, 0.2), away, np.ones(steps)], axis=1)
    one[turn:], other[turn:] = other[turn:].copy(), one[turn:].copy()
    return [own + rng.normal(0.0, SIGMA, own.shape) for own in (one, other)]


@pytest.mark.parametrize("turn", [6, 10, 14])
def test_both_are_cut_where_they_turned_into_each_other(turn: int) -> None:
    found = exchange_breaks(fitted(two(20, turn)), reach=2.5, least=0.0, apart=4)
    assert np.flatnonzero(found).tolist() == [turn, 20 + turn]


@pytest.mark.parametrize("crossed", [6, 10, 14])
def test_who_is_said_to_be_the_other_later_turned_where_both_lives_fit(crossed: int) -> None:
    paths = fitted(two(20, crossed))
    assert turn(paths, 0, 1, crossed - 5, crossed + 4) == [crossed, 20 + crossed]
    assert turn(paths, 0, 1, 18, 30) == [19, 39]
    assert turn(paths, 0, 1, 19, 30) == []


def test_who_goes_straight_on_is_not_cut() -> None:
    right = two(20, 10)
    right[0][10:], right[1][10:] = right[1][10:].copy(), right[0][10:].copy()
    assert not exchange_breaks(fitted(right), reach=2.5, least=-2.0, apart=4).any()


def test_the_order_of_paths_changes_nothing() -> None:
    places = two(20, 10)
    one = exchange_breaks(fitted(places), reach=2.5, least=0.0, apart=4)
    other = exchange_breaks(fitted(places[::-1]), reach=2.5, least=0.0, apart=4)
    assert one.tolist() == [*other[20:], *other[:20]]


def test_nobody_and_one_alone_have_nothing_to_exchange() -> None:
    assert not len(exchange_breaks(fitted([]), reach=2.5, least=0.0, apart=4))
    assert not exchange_breaks(fitted(two(20, 10)[:1]), reach=2.5, least=0.0, apart=4).any()


def exchanged(run: Run) -> int:
    """How often a person's track is another one than at the step before."""
    truth = run.sequence.ground_truth
    assert truth is not None
    count, before = 0, dict[int, int]()
    for step in range(run.sequence.frames):
        own, tracks = truth.at(step), run.tracks.at(step)
        apart = np.linalg.norm(
            truth.positions[own][:, None, :2] - run.tracks.positions[tracks][None, :, :2], axis=2
        )
        for i, j in zip(*linear_sum_assignment(apart), strict=True):
            person, track = int(truth.ids[own][i]), int(run.tracks.ids[tracks][j])
            count += apart[i, j] < 0.5 and before.get(person, track) != track
            before[person] = track
    return count


def test_a_crowded_room_at_two_steps_a_second_keeps_its_people() -> None:
    whole = random_room(6, fps=2.0, people=6, cameras=4, steps=60)
    of = {
        least: exchanged(
            pipeline.compute(
                whole,
                with_values(PLAIN, {"smoothing_method": "identities", "smoothing.exchange": least}),
            )
        )
        for least in (-2.0, 50.0)
    }
    assert of[-2.0] < of[50.0]
