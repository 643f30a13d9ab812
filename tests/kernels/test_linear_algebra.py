"""The small linear algebra of the kernels against NumPy, and sums over labels against tables."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy import ndarray
from numpy.testing import assert_allclose, assert_array_equal

from tests.filters.mixtures import random_covariances
from tracker.kernels import linear_algebra as kernels

seeds = st.integers(0, 2**32 - 1)


@given(seeds, st.integers(1, 6))
def test_factor_solution_and_length_are_those_of_numpy(seed: int, size: int) -> None:
    rng = np.random.default_rng(seed)
    matrix, right = random_covariances(rng, 1, size)[0], rng.normal(size=size)
    lower, solution = np.zeros((size, size)), np.empty(size)
    log_determinant = kernels.factorise(matrix, lower)
    assert_allclose(lower, np.linalg.cholesky(matrix), rtol=1e-9, atol=1e-12)
    assert log_determinant == pytest.approx(np.linalg.slogdet(matrix)[1], abs=1e-9)
    kernels.solve(lower, right, solution)
    assert_allclose(solution, np.linalg.solve(matrix, right), rtol=1e-6, atol=1e-9)
    length = right @ np.linalg.solve(matrix, right)
    assert kernels.squared_length(right, lower) == pytest.approx(length, rel=1e-8)


@pytest.mark.parametrize("matrix", [[[0.0]], [[-1.0]], [[np.nan]], [[1.0, 1.0], [1.0, 1.0]]])
def test_what_is_not_positive_definite_has_no_factor(matrix: list[list[float]]) -> None:
    with pytest.raises(np.linalg.LinAlgError, match="not positive definite"):
        kernels.factorise(np.array(matrix), np.zeros((len(matrix), len(matrix))))


@given(seeds, st.integers(0, 9), st.sampled_from((1, 3)))
def test_merged_moments_are_those_of_each_group(seed: int, size: int, dimension: int) -> None:
    rng = np.random.default_rng(seed)
    weights, means = rng.random(size), rng.normal(size=(size, dimension))
    covariances, group = random_covariances(rng, size, dimension), rng.integers(-1, 3, size)
    weights[group == 2] = 0.0  # then all of the group count the same
    found = kernels.merge_moments(weights, means, covariances, group, 3)
    for g in range(3):
        own = np.flatnonzero(group == g)
        assert found.weights[g] == pytest.approx(weights[own].sum())
        if not len(own):
            assert not found.means[g].any()
            assert not found.covariances[g].any()
            continue
        mean = np.average(means[own], axis=0, weights=weights[own] if g < 2 else None)
        offsets = means[own] - mean
        spreads = covariances[own] + np.einsum("ia,ib->iab", offsets, offsets)
        spread = np.average(spreads, axis=0, weights=weights[own] if g < 2 else None)
        assert_allclose(found.means[g], mean, atol=1e-12)
        assert_allclose(found.covariances[g], spread, atol=1e-9)


@given(st.lists(st.integers(-3, 3), max_size=9))
def test_labels_are_grouped_as_by_numpy(labels: list[int]) -> None:
    found = kernels.group_labels(np.array(labels, dtype=np.int64))
    distinct, places = np.unique(np.array(labels, dtype=np.int64), return_inverse=True)
    assert_array_equal(found.labels, distinct)
    assert_array_equal(found.places, places)


def test_a_point_on_the_border_is_inside_and_one_beyond_any_of_them_is_not() -> None:
    low, high = np.array([-1.0, -2.0, 0.0]), np.array([1.0, 2.0, 3.0])
    points = [[*low, 9.0], [*high, -9.0]]
    for axis in range(3):
        for border, away in ((low, -1e-9), (high, 1e-9)):
            beyond = [0.0, 0.0, 1.0, 0.0]
            beyond[axis] = border[axis] + away
            points.append(beyond)
    assert_array_equal(kernels.inside_bounds(np.array(points), low, high), [0, 1])
    assert_array_equal(kernels.inside_bounds(np.zeros((0, 4)), low, high), [])


def one_repeats(
    apart: tuple[float, float, float],
    *,
    weights: tuple[float, float] = (0.9, 0.9),
    labels: tuple[int, int] = (1, 2),
    sources: tuple[tuple[int, int], ...] = (),
) -> list[bool]:
    """Which of two people is a duplicate: near 0.5 m, height 0.7 m, sure from 0.5 on."""
    means = np.array([[1.0, 2.0, 0.8, 0.0], [1.0 + apart[0], 2.0 + apart[1], 0.8 + apart[2], 5.0]])
    boxes = np.array(sources, dtype=np.int64).reshape(-1, 2)
    found: ndarray = kernels.duplicates(
        means, np.array(weights), np.array(labels), boxes, 0.5, 0.7, 0.5
    )
    return found.tolist()


@pytest.mark.parametrize(
    ("case", "expected"),
    [
        ({"apart": (0.3, 0.0, 0.0)}, [False, True]),
        ({"apart": (0.3, 0.0, 0.0), "labels": (2, 1)}, [True, False]),
        # distance: at and below the bound, along each axis
        ({"apart": (0.5, 0.0, 0.0)}, [False, False]),
        ({"apart": (0.0, 0.499, 0.0)}, [False, True]),
        ({"apart": (0.3, 0.3, 0.3)}, [False, False]),
        ({"apart": (0.0, 0.0, 0.499)}, [False, True]),
        # a surer one stays, whoever is older; exactly the threshold is not sure
        ({"apart": (0.3, 0.0, 0.0), "weights": (0.4, 0.9)}, [True, False]),
        ({"apart": (0.3, 0.0, 0.0), "weights": (0.5, 0.9)}, [True, False]),
        ({"apart": (0.3, 0.0, 0.0), "weights": (0.5, 0.4)}, [False, True]),
        # boxes of their own part two, box 0 too; the same box does not, nor does a miss
        ({"apart": (0.3, 0.0, 0.0), "sources": ((-1, 4), (0, 1))}, [False, False]),
        ({"apart": (0.3, 0.0, 0.0), "sources": ((-1, 4), (1, 0))}, [False, False]),
        ({"apart": (0.3, 0.0, 0.0), "sources": ((0, 1), (2, 2))}, [False, False]),
        ({"apart": (0.3, 0.0, 0.0), "sources": ((0, -1), (2, 2))}, [False, True]),
        # at one place on the floor even so, unless one is above the other
        ({"apart": (0.249, 0.0, 0.0), "sources": ((0, 1),)}, [False, True]),
        ({"apart": (0.25, 0.0, 0.0), "sources": ((0, 1),)}, [False, False]),
        ({"apart": (0.0, 0.249, 0.699), "sources": ((0, 1),)}, [False, True]),
        ({"apart": (0.0, 0.0, 0.7), "sources": ((0, 1),)}, [False, False]),
        ({"apart": (0.0, 0.0, -0.701)}, [False, False]),
    ],
)
def test_who_repeats_another(case: dict, expected: list[bool]) -> None:
    assert one_repeats(**case) == expected


@given(seeds, st.integers(0, 12), st.integers(0, 4))
def test_pairs_are_summed_as_in_a_table(seed: int, count: int, components: int) -> None:
    rng = np.random.default_rng(seed)
    labels = rng.integers(0, 4, components)
    cameras, of_pairs, boxes = (rng.integers(0, high, count) for high in (2, 5, 3))
    weights = rng.uniform(0.0, 0.7, count)
    table: dict[tuple[int, int, int], float] = {}
    for camera, label, box, weight in zip(cameras, of_pairs, boxes, weights, strict=True):
        if label in labels:
            key = (int(camera), labels.tolist().index(label), int(box))
            table[key] = table.get(key, 0.0) + weight
    found = kernels.sum_pairs(labels, cameras, of_pairs, boxes, weights)
    keys = zip(found.cameras.tolist(), found.components.tolist(), found.boxes.tolist(), strict=True)
    assert list(keys) == sorted(table)
    assert_allclose(found.probabilities, [min(table[k], 1.0) for k in sorted(table)], rtol=1e-6)
