"""What targets do by their case: those hidden in a piece, those who come near each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy import ndarray
from numpy.testing import assert_allclose, assert_array_equal

from tracker.parameters.groups.jpda import JpdaParams
from tracker.single_view.jpda.cases import Cases, CaseUpdates, _left_over, update_by_case
from tracker.single_view.jpda.measurements import Measured
from tracker.single_view.jpda.targets import Targets, innovations

HALF = (4.0, 9.0)


def targets(*places: tuple[float, float], speeds: tuple[float, float] = (0.0, 0.0)) -> Targets:
    """People of one size and one velocity."""
    boxes = np.array([[*place, *HALF] for place in places])
    labels = np.arange(1, len(boxes) + 1)
    some = Targets.at_rest(boxes, np.full((len(boxes), 4), 1.5), 1.0, labels)
    some.means[:, [1, 3]] = speeds
    return some


def measured(boxes: list[tuple[float, ...]], pieces: list[tuple[float, ...]]) -> Measured:
    found = np.array(boxes, dtype=float)
    ones = np.ones(len(found))
    return Measured(found, ones, np.ones((len(found), 4)), np.array(pieces, dtype=float))


def moved(
    some: Targets,
    seen: Measured,
    matrix: list[list[float]],
    own: list[int],
    shared: list[int],
    p: JpdaParams | None = None,
) -> CaseUpdates:
    """One step of targets whose cases are told."""
    none = np.zeros(some.size, dtype=bool)
    cases = Cases(np.array(own), np.array(shared), none, none, np.zeros(len(seen.boxes), bool))
    found = innovations(some, seen.boxes[:, :2], seen.sigmas[:, :2])
    return update_by_case(some, found, np.array(matrix), cases, seen, p or JpdaParams())


def test_an_edge_that_who_is_in_front_leaves_over_is_of_who_is_behind() -> None:
    # in front at (100, 100); the piece reaches 5 px further left, and 6 further down
    front, piece = (100.0, 100.0, *HALF), (97.5, 103.0, 6.5, 12.0)
    some, seen = targets((100, 100), (99, 102)), measured([front], [piece])
    for _ in range(8):
        some = moved(some, seen, [[1.0], [0.0]], [0, -1], [0, 0]).targets
    assert_allclose(some.positions, [[100.0, 100.0], [95.0, 106.0]], atol=0.4)


def test_who_is_hidden_never_leaves_the_piece() -> None:
    some = targets((100, 100), (99, 100), speeds=(200.0, -100.0))
    seen = measured([(100.0, 100.0, *HALF)], [(101.0, 101.0, 6.0, 11.0)])
    result = moved(some.predict(0.2, 8.0), seen, [[1.0], [0.0]], [0, -1], [0, 0])
    inside = np.abs(result.targets.positions[1] - [101.0, 101.0])
    assert (inside <= [2.0 + 1e-9, 2.0 + 1e-9]).all()
    assert_array_equal(result.hidden, [False, True])


def test_two_hidden_in_one_piece_leave_its_edges_open() -> None:
    some = targets((100, 100), (99, 100), (98, 101))
    seen = measured([(100.0, 100.0, *HALF)], [(97.5, 103.0, 6.5, 12.0)])
    result = moved(some, seen, [[1.0], [0.0], [0.0]], [0, -1, -1], [0, 0, 0])
    assert_allclose(result.targets.positions[1:], some.positions[1:], atol=0.01)


EDGES: list[tuple[str, tuple[float, ...], list[tuple[float, ...]], list[int]]] = [
    ("left and below", (97.5, 103, 6.5, 12), [(100, 100, *HALF)], [-1, 1]),
    ("nothing", (100, 100, *HALF), [(100, 100, *HALF)], [0, 0]),
    ("both sides", (100, 100, 9, 9), [(100, 100, *HALF)], [0, 0]),
    ("legs of somebody tall", (100, 130, 4, 39), [(100, 100, *HALF)], [0, 0]),
    ("two in front", (103, 100, 8, 9), [(99, 100, *HALF), (104, 100, *HALF)], [1, 0]),
]


@pytest.mark.parametrize(
    ("piece", "shown", "edges"), [row[1:] for row in EDGES], ids=[row[0] for row in EDGES]
)
def test_which_edges_are_left_over(
    piece: tuple[float, ...], shown: list[tuple[float, ...]], edges: list[int]
) -> None:
    boxes: ndarray = np.array(shown, dtype=float)
    found = _left_over(np.array(piece, dtype=float), boxes, np.array(HALF), JpdaParams().one_side)
    assert_array_equal(found, edges)


def test_of_two_measurements_that_both_may_have_made_each_takes_its_own() -> None:
    some = targets((100, 100), (103, 100))
    seen = measured([(98.0, 100.0, *HALF), (105.0, 100.0, *HALF)], [(98.0, 100.0, *HALF)] * 2)
    shares = [[0.55, 0.45], [0.45, 0.55]]
    result = moved(some, seen, shares, [0, 1], [-1, -1])
    assert_allclose(result.matrix, np.eye(2))
    apart = result.targets.positions[1, 0] - result.targets.positions[0, 0]
    assert apart > 5.0, "neither is drawn to the middle"
    # by the mean over all associations they would have come closer
    below = moved(some, seen, shares, [0, 1], [-1, -1], JpdaParams(least_probability=0.5))
    assert below.targets.positions[1, 0] - below.targets.positions[0, 0] < 4.0
    classical = moved(some, seen, shares, [0, 1], [-1, -1], JpdaParams(five_cases=False))
    assert_allclose(classical.matrix, shares)


def test_sizes_follow_what_is_measured_and_counts_what_became_of_each() -> None:
    """By their cases: measured whole, missed, split, hidden behind another, and hidden itself."""
    p = JpdaParams(size_rate=0.25)
    some = targets((100, 100), (200, 100), (300, 100), (400, 100), (404, 100))
    some = replace(some, misses=np.array([2, 2, 0, 0, 0]), hidden=np.array([0, 3, 0, 0, 4]))
    rows = [(100.0, 100.0, 6.0, 12.0), (300.0, 100.0, 6.0, 12.0), (400.0, 100.0, *HALF)]
    seen = measured(rows, [*rows[:2], (402.0, 100.0, 9.0, 12.0)])
    own, shared = np.array([0, -1, 1, 2, -1]), np.array([-1, -1, -1, 2, 2])
    flags = np.eye(5, dtype=bool)
    cases = Cases(own, shared, flags[2], flags[1], np.zeros(3, bool))
    matrix = np.zeros((5, 3))
    matrix[[0, 2, 3], [0, 1, 2]] = 0.8, 0.9, 1.0
    found = innovations(some, seen.boxes[:, :2], seen.sigmas[:, :2])
    result = update_by_case(some, found, matrix, cases, seen, p)
    after = result.targets
    assert after.hits.tolist() == [2, 0, 2, 2, 2]
    assert after.misses.tolist() == [0, 3, 0, 0, 0]
    assert after.hidden.tolist() == [0, 0, 0, 0, 5]
    expected = np.tile(HALF, (5, 1))
    expected[0] += 0.25 * 0.8 * (np.array([6.0, 12.0]) - HALF)
    # of the fourth, which is in front, the box is as large as it was
    assert_allclose(after.half_sizes, expected)
    assert result.hidden.tolist() == [False, False, False, False, True]
    assert not result.matrix[[1, 4]].any()


@pytest.mark.parametrize(
    ("factors", "alike"),
    [((1.49, 1.0), True), ((1.51, 1.0), False), ((1.0, 0.67), True), ((1.0, 0.66), False)],
)
def test_who_is_in_front_has_a_box_of_about_the_own_size(
    factors: tuple[float, float], alike: bool
) -> None:
    some = targets((100, 100))
    seen = measured([(100.0, 100.0, *np.multiply(HALF, factors))], [(100.0, 100.0, 9.0, 12.0)])
    result = moved(some, seen, [[1.0]], [0], [0], JpdaParams(same_size=1.5))
    assert result.hidden.tolist() == [not alike]
