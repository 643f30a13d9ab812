"""Linear algebra, association and the measurement model of the kernels against NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy import ndarray
from numpy.testing import assert_allclose, assert_array_equal
from scipy.optimize import linear_sum_assignment

from tests.filters.mixtures import random_covariances
from tests.world import PERSON, ring
from tracker.fusion.target_model import MeasurementKind, TargetModel
from tracker.kernels import boxes as box_kernels
from tracker.kernels import linear_algebra as kernels
from tracker.kernels import measurement
from tracker.kernels.association import (
    Convergence,
    assign,
    augment,
    belief_propagation,
    disjoint_matchings,
)

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


def messages(
    missed: ndarray, detected: ndarray, unexplained: ndarray, convergence: Convergence
) -> tuple[ndarray, ndarray, int]:
    """Rows (n, 1 + M), columns (M,), and how many rounds it took."""
    there, totals, rounds = detected > 0.0, unexplained, 0
    to_target = there / unexplained
    for _ in range(convergence.iterations):
        rest = missed[:, None] + (detected * to_target).sum(axis=1)[:, None] - detected * to_target
        to_measurement = detected / rest
        totals = unexplained + to_measurement.sum(axis=0)
        before, to_target = to_target, there / (totals - to_measurement)
        rounds += 1
        if (np.abs(to_target - before) * unexplained).max(initial=0.0) < convergence.tolerance:
            break
    rows = np.column_stack([missed, detected * to_target])
    return rows / rows.sum(axis=1)[:, None], unexplained / totals, rounds


@given(
    seeds, st.integers(0, 5), st.integers(0, 5),
    st.sampled_from((0.3, 0.03, 1e-6)), st.sampled_from((0, 1, 2, 200)),
)  # fmt: skip
def test_messages_pass_until_they_settle(
    seed: int, targets: int, count: int, tolerance: float, most: int
) -> None:
    rng = np.random.default_rng(seed)
    missed, unexplained = rng.uniform(0.02, 1.0, targets), rng.lognormal(-1.0, 2.0, count)
    detected = rng.lognormal(0.0, 2.0, (targets, count)) * (rng.random((targets, count)) < 0.7)
    convergence = Convergence(tolerance, most)
    rows, columns, rounds = messages(missed, detected, unexplained, convergence)
    found = belief_propagation(missed, detected, unexplained, convergence)
    assert_allclose(found.rows, rows, rtol=1e-9)
    assert_allclose(found.unexplained, columns, rtol=1e-9)
    assert rounds <= most


@given(seeds, st.integers(1, 12), st.integers(1, 6), st.sampled_from((0.2, 0.6, 1.0)))
def test_each_matching_is_the_heaviest_of_what_those_before_left(
    seed: int, size: int, most: int, share: float
) -> None:
    rng = np.random.default_rng(seed)
    weights = rng.integers(1, 9, (size, size)) * (rng.random((size, size)) < share)
    found = disjoint_matchings(weights.astype(float), most)
    left = weights.astype(float)
    assert 1 <= len(found) <= most
    for k, columns in enumerate(found):
        rows = np.flatnonzero(columns >= 0)
        assert (left[rows, columns[rows]] > 0.0).all()
        assert len(set(columns[rows].tolist())) == len(rows)
        best = linear_sum_assignment(left, maximize=True)
        assert left[rows, columns[rows]].sum() == left[best].sum()
        left[rows, columns[rows]] = 0.0
        assert len(rows) > 0 or k == len(found) - 1
    assert len(found) == most or not left.any()


@given(seeds, st.integers(1, 7), st.sampled_from((0.0, 0.4, 0.8)))
def test_an_assignment_is_the_cheapest_and_its_duals_prove_it(
    seed: int, size: int, forbidden: float
) -> None:
    rng = np.random.default_rng(seed)
    cost = rng.integers(0, 6, (size, size)).astype(float)
    cost[rng.random((size, size)) < forbidden] = np.inf
    rows, columns = np.zeros(size), rng.integers(-2, 3, size).astype(float)
    column_of, row_of = np.zeros(size, dtype=np.int64), np.zeros(size, dtype=np.int64)
    try:
        best = cost[linear_sum_assignment(cost)].sum()
    except ValueError:  # there is none of finite cost
        assert not assign(cost, rows, columns, column_of, row_of)
        return
    assert assign(cost, rows, columns, column_of, row_of)
    assert_array_equal(row_of[column_of], np.arange(size))
    assert cost[np.arange(size), column_of].sum() == best
    assert (cost - rows[:, None] - columns >= -1e-9).all()
    assert rows.sum() + columns.sum() == best
    # a closed column stays with its row
    closed = np.zeros(size, dtype=np.bool_)
    closed[column_of[1:]] = rng.random(size - 1) < 0.5
    kept = [(row_of[j], j) for j in np.flatnonzero(closed)]
    free, column_of[0] = column_of[0], -1
    row_of[free] = -1
    cost[0, free] = np.inf
    before = column_of.copy(), row_of.copy()
    if augment(cost, 0, rows, columns, column_of, row_of, closed):
        assert all(column_of[i] == j for i, j in kept)
        assert_array_equal(row_of[column_of], np.arange(size))
        cost[:, closed] = np.inf
        for i, j in kept:
            cost[i] = np.where(np.arange(size) == j, 0.0, np.inf)
        best = cost[linear_sum_assignment(cost)].sum()
        assert cost[np.arange(size), column_of].sum() == best
    else:
        assert_array_equal(column_of, before[0])
        assert_array_equal(row_of, before[1])


CAMERA = ring(1)[0]
KINDS: tuple[MeasurementKind, ...] = ("centre", "box", "box_and_width")


@pytest.mark.parametrize("kind", KINDS)
def test_a_box_and_its_noise_are_transformed_alike(kind: MeasurementKind) -> None:
    rng = np.random.default_rng(0)
    transform, products = TargetModel(PERSON, kind).transforms
    boxes, variances = rng.uniform(5.0, 200.0, (7, 4)), rng.uniform(1.0, 30.0, (7, 4))
    values, noises = measurement.measured_boxes(boxes, variances, transform, products)
    assert_allclose(values, boxes @ transform.T, rtol=1e-12)
    assert_allclose(
        noises, np.einsum("pa,ma,qa->mpq", transform, variances, transform), rtol=1e-12, atol=1e-12
    )


@pytest.mark.parametrize("kind", KINDS)
def test_the_unscented_regression_is_that_of_numpy(kind: MeasurementKind) -> None:
    """Values, slopes and what is left of six points, each by its defining equation."""
    rng = np.random.default_rng(1)
    camera, model = CAMERA, TargetModel(PERSON, kind, "unscented")
    states = np.concatenate(
        [rng.uniform(-1.0, 1.0, (5, 2)), np.full((5, 1), 0.84), rng.normal(size=(5, 3))], axis=1
    )
    roots = rng.normal(0.0, 0.1, (5, 6, 6))
    covariances = roots @ roots.transpose(0, 2, 1) + 0.01 * np.eye(6)
    found = model.expected(camera, states, covariances)
    for j, (state, covariance) in enumerate(zip(states, covariances, strict=True)):
        spread = covariance[:3, :3]
        lower = np.linalg.cholesky(spread)
        offsets = np.sqrt(3.0) * np.concatenate([lower.T, -lower.T])
        drawn = box_kernels.expected_boxes(
            state[:3] + offsets, model.half_height, model.half_width, model.size, camera.calibration
        )
        values = drawn.values
        assert drawn.valid.all()
        off = values - values.mean(axis=0)
        slopes = (off.T @ offsets / 6.0) @ np.linalg.inv(spread)
        assert_allclose(found.values[j], values.mean(axis=0), rtol=1e-12)
        assert_allclose(found.jacobians[j, :, :3], slopes, rtol=1e-7, atol=1e-7)
        assert not found.jacobians[j, :, 3:].any()
        left = off.T @ off / 6.0 - slopes @ spread @ slopes.T
        assert_allclose(found.spreads[j], left, rtol=1e-6, atol=1e-6)
        assert np.abs(found.spreads[j]).max() > 1e-3, "the projection bends"


def target(size: int, unscented: bool) -> measurement.Target:
    """A person who may lie, and whose box may then be off in all its numbers together."""
    noise = np.arange(size * size, dtype=float).reshape(size, size)
    return measurement.Target(
        0.85, 0.3, size, unscented, 0.35, 0.6, noise + noise.T, np.eye(6), 0.2
    )


@pytest.mark.parametrize("size", [2, 3, 4])
def test_in_another_posture_the_box_is_another_and_off_by_its_height(size: int) -> None:
    # near, far away (half a box is less than a pixel), and with the feet behind the lens
    ahead = CAMERA.rotation[2]
    beside = CAMERA.centre + 0.05 * ahead + [0.0, 0.0, 0.6]
    places = np.array([[0.3, 0.2, 0.85], CAMERA.centre + 900.0 * ahead, beside])
    states = np.concatenate([places, np.zeros((3, 3))], axis=1)
    who = target(size, False)
    found = measurement.expected_measurements(
        states, np.zeros((3, 6, 6)), who, CAMERA.calibration
    ).expected
    upright = box_kernels.expected_boxes(states, 0.85, 0.3, size, CAMERA.calibration)
    lying = box_kernels.expected_boxes(states, 0.35, 0.6, size, CAMERA.calibration)
    assert lying.valid.tolist() == [True, True, False]
    assert_allclose(found.values, upright.values)
    assert_allclose(found.jacobians, upright.jacobians)
    assert_allclose(found.posture_values[:2], lying.values[:2])
    assert np.isposinf(found.posture_values[2]).all()
    assert_allclose(found.posture_jacobians, lying.jacobians)
    heights = (upright.boxes[:, 3] - upright.boxes[:, 1]) / 2.0
    assert heights[0] > 50.0 > 1.0 > heights[1]
    scales = np.maximum(heights, 1.0) ** 2
    assert_allclose(found.posture_spreads, scales[:, None, None] * who.posture_noise)
    assert (found.posture_share, found.spreads.shape) == (0.2, (0, size, size))


def test_where_part_of_the_uncertainty_is_behind_the_lens_the_slope_counts() -> None:
    near = CAMERA.centre + 1.2 * CAMERA.rotation[2] * [1.0, 1.0, 0.0]
    states = np.concatenate([np.array([near, [0.0, 0.0, 0.85]]), np.zeros((2, 3))], axis=1)
    covariances = np.tile(0.6 * np.eye(6), (2, 1, 1))
    found = measurement.expected_measurements(
        states, covariances, target(3, True), CAMERA.calibration
    ).expected
    straight = box_kernels.expected_boxes(states, 0.85, 0.3, 3, CAMERA.calibration)
    assert straight.valid.all()
    assert_allclose(found.values[0], straight.values[0])
    assert_allclose(found.jacobians[0], straight.jacobians[0])
    assert not found.spreads[0].any()
    assert found.spreads[1].any()
