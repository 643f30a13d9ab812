"""A background made by people who stay is doubted, and what moves in front of it is foreground."""

from __future__ import annotations

import numpy as np
import pytest
from numpy import ndarray
from numpy.testing import assert_array_equal

from tracker.parameters.groups.foreground import ForegroundParams
from tracker.single_view.pictures.background import BackgroundModel, MovingForeground
from tracker.single_view.pictures.foreground import spread_steps


def plain(level: int = 100) -> ndarray:
    return np.full((60, 80, 3), level, dtype=np.uint8)


def model(changing_share: float) -> BackgroundModel:
    return BackgroundModel(plain(), np.zeros((60, 80), dtype=np.uint8), changing_share)


def test_doubt_rises_smoothly_with_the_restlessness() -> None:
    p = ForegroundParams(restless_from=0.2, restless_to=0.6)
    found = [model(r).uncertainty(p) for r in (0.0, 0.2, 0.3, 0.4, 0.5, 0.6, 1.0)]
    np.testing.assert_allclose(found, [0.0, 0.0, 0.15625, 0.5, 0.84375, 1.0, 1.0])


def test_restless_are_pixels_that_are_away_in_more_than_three_of_ten_pictures() -> None:
    # of patches of 40 pixels that show something else in so many of ten pictures
    pictures = [plain() for _ in range(10)]
    for row, count in enumerate((1, 2, 3, 4)):
        for k in range(count):
            pictures[(2 * k + row) % 10][10 * row : 10 * row + 4, 20:30] = 170
    learnt = BackgroundModel.learn(pictures)
    assert learnt is not None
    assert learnt.changing_share == pytest.approx(1 / 3)
    # a single pixel of thousands says nothing
    few = [plain() for _ in range(10)]
    for k in range(5):
        few[2 * k][30, 40] = 170
    learnt = BackgroundModel.learn(few)
    assert learnt is not None
    assert learnt.changing_share == 0.0


@pytest.mark.parametrize(
    ("memory", "changing_share", "time", "lasting"),
    [(0.4, 1.0, 0.1, 4), (0.4, 0.5, 0.1, 2), (0.5, 1.0, 0.1, 5), (4.0, 1.0, 0.01, 254)],
)
def test_a_change_counts_for_the_length_of_the_memory(
    memory: float, changing_share: float, time: float, lasting: int
) -> None:
    p = ForegroundParams(motion_memory=memory, restless_from=0.0, restless_to=1.0, threshold=128.0)
    moving = MovingForeground(model(changing_share), p, time)
    assert moving.memory == lasting
    if lasting > 10:
        return
    state, seen = moving.start(), []
    for step in range(9):
        picture = plain()
        picture[20:40, 30:50] = 100 if step < 2 else 190
        state, found = moving.step(state, picture)
        assert set(np.unique(found.mask)) <= {0, 1}
        seen.append(bool(found.mask[25:35, 35:45].all()))
        assert not found.mask[:, :20].any()
        assert_array_equal(found.thresholds, 128.0)
    # from the step of the change on
    assert seen == [2 <= step < 2 + lasting for step in range(9)]


def test_pictures_are_compared_over_a_tenth_of_a_second() -> None:
    p = ForegroundParams(restless_from=0.0, restless_to=0.5, threshold=128.0, motion_memory=0.05)
    moving = MovingForeground(model(1.0), p, 0.05)
    state, seen = moving.start(), []
    for step in range(6):
        picture = plain()
        picture[20:40, 30:50] = 100 if step < 2 else 190
        state, found = moving.step(state, picture)
        seen.append(bool(found.mask[25:35, 35:45].all()))
    assert len(state.before) == 2
    assert seen == [False, False, True, True, False, False]  # against two pictures ago


def test_a_change_of_more_than_half_of_the_picture_is_none() -> None:
    p = ForegroundParams(restless_from=0.0, restless_to=0.5, threshold=128.0, motion_memory=0.3)
    for rows, moved in ((27, True), (33, False)):
        moving = MovingForeground(model(1.0), p, 0.1)
        state, _ = moving.step(moving.start(), plain())
        picture = plain()
        picture[:rows] = 190
        _, found = moving.step(state, picture)
        assert found.mask.any() == moved


def test_a_background_is_learnt_from_steps_all_over_the_clip() -> None:
    assert spread_steps(range(5)) == [0, 1, 2, 3, 4]
    assert spread_steps(range(3, 4)) == [3]
    many = spread_steps(range(10, 1000))
    assert (len(many), many[0], many[-1]) == (32, 10, 999)
    assert set(np.diff(many)) <= {31, 32}
