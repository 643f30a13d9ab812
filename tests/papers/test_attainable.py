"""What corrections can win at most."""

from __future__ import annotations

import numpy as np
import pytest

from tests.engine.synthetic import sequence as boxes_of
from tests.papers.laboratory.attainable import Attainable, attainable
from tracker.evaluation import EvaluationSettings
from tracker.fusion.trajectories import Trajectories

STEPS = 40
PATHS = {1: 0.0, 2: 5.0, 3: 10.0}
"""Each person's x, who stands there all the time."""


def tracks(ids: dict[int, list[int]]) -> Trajectories:
    """By person, the id that he has at each step, 0 where he has none."""
    rows = sorted(
        (step, own, PATHS[who])
        for who, every in ids.items()
        for step, own in enumerate(every)
        if own
    )
    steps, names, x = (np.array(column) for column in zip(*rows, strict=True))
    count = len(steps)
    return Trajectories(
        frames=steps, ids=names, positions=np.column_stack([x, np.zeros(count), np.ones(count)]),
        existences=np.ones(count), sigmas=np.ones((count, 3)), seen=np.ones((count, 1), bool),
        components=np.zeros(count, int), labels=names, covariances_xy=np.zeros(count),
        heights=np.full(count, np.nan), sigma_heights=np.full(count, np.nan),
    )  # fmt: skip


def won(ids: dict[int, list[int]], changes: int) -> Attainable:
    whole = boxes_of([(0, np.tile([x, 0.0, 1.0], (STEPS, 1))) for x in PATHS.values()], STEPS)
    return attainable(whole, tracks(ids), EvaluationSettings(gate=1.0), changes)


def test_two_who_are_exchanged_are_put_right_by_one_change_and_no_second_is_made() -> None:
    found = won({1: [1] * 25 + [2] * 15, 2: [2] * 25 + [1] * 15, 3: [3] * STEPS}, 5)
    assert found.best == pytest.approx((1.0 - 30 / 120, 1.0))
    assert found.identities == 1.0


def test_the_change_that_wins_most_comes_first_and_who_is_not_found_stays_lost() -> None:
    ids = {
        1: [1] * 20 + [4] * 20,  # goes on under another id
        2: [2] * 32 + [3] * 8,  # and the third's track, which ends, goes on as the second's
        3: [3] * 32 + [0] * 8,
    }
    found = won(ids, 2)
    rows, people = 112, 120
    first, second = (2.0 * right / (rows + people) for right in (104, 112))
    assert found.best[1:] == pytest.approx((first, second))
    assert found.identities == pytest.approx(second)
