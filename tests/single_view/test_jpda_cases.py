"""The five cases, read from association matrices written down by hand."""

from __future__ import annotations

import numpy as np
import pytest
from numpy import ndarray
from numpy.testing import assert_array_equal

from tracker.parameters.groups.jpda import JpdaParams
from tracker.single_view.jpda.cases import (
    Cases,
    determine_cases,
    exclude_outside_boxes,
    search_components,
)

LEAP = JpdaParams().leap


def read(rows: list[list[float]], own: list[int], *, every: bool = False) -> Cases:
    """The cases of a matrix of targets (rows) and measurements (columns)."""
    matrix = np.array(rows, dtype=float).reshape(len(own), len(rows[0]) if rows else 0)
    return determine_cases(matrix, np.array(own), 0.05, every_shared_row=every)


def boxes(*rows: tuple[float, ...]) -> ndarray:
    return np.array(rows, dtype=float).reshape(-1, 4)


TABLE = [
    # name, β (targets × measurements), likeliest event, shared, split, missed, new
    ("normal", [[0.9, 0.0], [0.0, 0.95]], [0, 1], [-1, -1], [0, 0], [0, 0], [0, 0]),
    ("new", [[0.9, 0.0]], [0], [-1], [0], [0], [0, 1]),
    ("new by a tiny entry", [[0.9, 0.04]], [0], [-1], [0], [0], [0, 1]),
    ("vanished", [[0.9], [0.0]], [0, -1], [-1, -1], [0, 0], [0, 1], [0]),
    ("occluded", [[0.5], [0.45]], [0, -1], [0, 0], [0, 0], [0, 0], [0]),
    ("three in one", [[0.4], [0.3], [0.2]], [0, -1, -1], [0, 0, 0], [0] * 3, [0] * 3, [0]),
    ("close, not occluded", [[0.7, 0.2], [0.2, 0.7]], [0, 1], [-1, -1], [0, 0], [0, 0], [0, 0]),
    ("split", [[0.6, 0.35]], [0], [-1], [1], [0], [0, 0]),
    ("a piece of another's", [[0.6, 0.2], [0.0, 0.7]], [0, 1], [-1, -1], [0, 0], [0, 0], [0, 0]),
    ("nobody there", [], [], [], [], [], []),
    ("nothing measured", [[], []], [-1, -1], [-1, -1], [0, 0], [1, 1], []),
]


@pytest.mark.parametrize(
    ("rows", "own", "shared", "split", "missed", "new"),
    [row[1:] for row in TABLE],
    ids=[str(row[0]) for row in TABLE],
)
def test_rows_and_columns_tell_the_case(
    rows: list, own: list, shared: list, split: list, missed: list, new: list
) -> None:
    cases = read(rows, own)
    assert_array_equal(cases.shared, shared)
    assert_array_equal(cases.split, np.array(split, dtype=bool))
    assert_array_equal(cases.missed, np.array(missed, dtype=bool))
    assert_array_equal(cases.new, np.array(new, dtype=bool))


def test_as_published_every_shared_row_is_an_occlusion() -> None:
    cases = read([[0.7, 0.2, 0.0], [0.2, 0.7, 0.0], [0.0, 0.0, 0.9]], [0, 1, 2], every=True)
    assert_array_equal(cases.shared, [0, 1, -1])
    assert_array_equal(read([[0.5], [0.4]], [0, -1], every=True).shared, [0, 0])


def test_as_published_two_in_one_place_part_to_two_measurements() -> None:
    # the likeliest event may leave one of them without, and both come nearest to the first
    cases = read([[0.5, 0.3], [0.5, 0.3]], [0, -1], every=True)
    assert_array_equal(np.sort(cases.shared), [0, 1])
    # whom no measurement is left for takes that of another
    cases = read([[0.5, 0.2], [0.3, 0.4], [0.3, 0.0]], [0, 1, -1], every=True)
    assert_array_equal(cases.shared, [0, 1, 0])


def test_nobody_has_measurements_without_targets() -> None:
    cases = determine_cases(np.zeros((0, 3)), np.zeros(0, dtype=int), 0.1, every_shared_row=False)
    assert cases.new.all()
    assert len(cases.shared) == 0


def test_of_a_split_target_what_lies_outside_its_box_is_somebody_new() -> None:
    matrix = np.array([[0.5, 0.3, 0.15]])
    cases = determine_cases(matrix, np.array([0]), 0.05, every_shared_row=False)
    expected = boxes((100, 100, 10, 20))
    measured = boxes((100, 95, 8, 9), (101, 112, 8, 9), (118, 100, 8, 18))
    parted, shares = exclude_outside_boxes(cases, matrix, expected, measured)
    assert_array_equal(parted.new, [False, False, True])
    assert_array_equal(parted.split, [True])
    np.testing.assert_allclose(shares, [[0.65, 0.3, 0.0]])


def test_who_is_lost_in_a_piece_is_hidden_behind_its_owner() -> None:
    # the second target's centre lies in the piece that the first one has
    cases = read([[0.9], [0.0]], [0, -1])
    found = search_components(
        cases,
        boxes((100, 100, 10, 20), (116, 98, 10, 20)),
        boxes((100, 100, 10, 20)),
        boxes((108, 100, 18, 22)),
        LEAP,
    )
    assert_array_equal(found.shared, [0, 0])
    assert not found.missed.any()


def test_a_free_measurement_near_a_lost_target_is_its_own() -> None:
    cases = read([[0.0, 0.0]], [-1])
    expected = boxes((100, 100, 10, 20))
    measured = boxes((115, 100, 10, 20), (180, 100, 10, 20))
    found = search_components(
        cases, expected, measured, boxes((110, 100, 30, 30), (180, 99, 9, 9)), LEAP
    )
    assert_array_equal(found.own, [0])
    assert_array_equal(found.new, [False, True])
    assert not found.missed.any()
    # one that is too far away stays somebody new, who hides it
    far = boxes((130, 100, 10, 20))
    found = search_components(read([[0.0]], [-1]), expected, far, boxes((110, 100, 40, 30)), LEAP)
    assert_array_equal(found.own, [-1])
    assert_array_equal(found.shared, [0])
    assert found.new.all()


def test_who_is_nowhere_stays_missed() -> None:
    cases = read([[0.0]], [-1])
    found = search_components(
        cases, boxes((10, 10, 5, 5)), boxes((200, 200, 5, 5)), boxes((200, 200, 9, 9)), LEAP
    )
    assert found.missed.all()
    assert found.new.all()
