"""Tracking in one camera by data association: targets, the matrix, the five cases, the tops."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from hypothesis import given
from hypothesis import strategies as st
from numpy import ndarray
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import chi2

from tests import world
from tests.single_view.scenery import detected, run
from tests.world import SMALL_CAMERAS as CAMERAS
from tests.world import SMALL_ROOM as ROOM
from tracker.parameters.catalogue import PRESETS, RunParameters
from tracker.parameters.groups.jpda import JpdaParams
from tracker.parameters.values import stage_values, with_values
from tracker.sequences.sequence import Room
from tracker.single_view.box_sizes import upright_boxes
from tracker.single_view.jpda import method
from tracker.single_view.jpda import targets as kalman
from tracker.single_view.jpda.cases import (
    Cases,
    CaseUpdates,
    _left_over,
    determine_cases,
    exclude_outside_boxes,
    search_components,
    update_by_case,
)
from tracker.single_view.jpda.crowns import TargetSizes, crowns
from tracker.single_view.jpda.measurements import Measured
from tracker.single_view.jpda.method import associate
from tracker.single_view.jpda.targets import Innovations, Targets, innovations
from tracker.single_view.protocol import ViewResult

HALF = (6.0, 12.0)
PUBLISHED = {
    key.removeprefix("jpda."): value
    for key, value in PRESETS["published"].items()
    if key.startswith("jpda.") and key != "jpda.measurements"
}


def track(steps: list[list[tuple[float, ...]]], **changes: Any) -> list[ViewResult]:
    """The results of all steps; boxes are centre x and y, and half sizes if not the usual."""
    boxes = [[(*box, *HALF)[:4] if len(box) == 2 else box for box in step] for step in steps]
    return run("jpda", detected(boxes, fps=25.0), **{"confirmation_steps": 1, **changes})


def events_of(results: list[ViewResult], kind: str) -> list[tuple[int, tuple[int, ...]]]:
    """Step and labels of all events of a kind."""
    return [(k, e.labels) for k, r in enumerate(results) for e in r.events if e.kind == kind]


def walking(steps: int, x: float = 30.0, speed: float = 1.5) -> list[tuple[float, float]]:
    return [(x + speed * k, 60.0) for k in range(steps)]


def meeting(steps: int = 60, merged: range = range(24, 36)) -> list:
    """Two pass each other; where they overlap a detector sees one box around both."""
    boxes: list = []
    for k in range(steps):
        left, right = (30.0 + 1.6 * k, 58.0), (125.0 - 1.6 * k, 62.0)
        if k in merged:
            low, high = sorted((left[0], right[0]))
            middle = (low + high) / 2.0
            boxes.append([(middle, 60.0, 6.0 + (high - low) / 2.0, 14.0)])
        else:
            boxes.append([left, right])
    return boxes


def test_two_who_pass_each_other_keep_their_labels() -> None:
    results = track(meeting())
    assert events_of(results, "new") == [(0, (1, )), (0, (2,))]  # fmt: skip
    assert not events_of(results, "vanished")
    occluded = [k for k, labels in events_of(results, "occluded") if labels == (1, 2)]
    assert set(occluded) >= set(range(26, 36))
    for k in (20, 50):
        places = dict(zip(results[k].labels.tolist(), results[k].estimates[:, 0], strict=True))
        assert places[1] == pytest.approx(30.0 + 1.6 * k, abs=3.0)
        assert places[2] == pytest.approx(125.0 - 1.6 * k, abs=3.0)
    # while nobody knows who is where, nobody is handed on
    assert len(results[26].boxes) == 0
    assert len(results[26].estimates) == 2


def test_as_published_the_occluded_stand_still_in_the_middle_of_what_is_seen() -> None:
    steps = meeting(merged=range(28, 33))
    results = track(steps, **PUBLISHED)
    assert {k for k, labels in events_of(results, "occluded") if labels == (1, 2)} >= {
        29,
        30,
        31,
        32,
    }
    middle = results[30]
    assert len(middle.boxes) == 2
    np.testing.assert_allclose(middle.boxes[0, :2], middle.boxes[1, :2])
    np.testing.assert_allclose(middle.boxes[0, :2], [77.5, 60.0], atol=0.5)
    # after it both are followed apart, who is who is anybody's guess
    assert sorted(results[-1].labels.tolist()) == [1, 2]
    assert np.ptp(results[-1].boxes[:, 0]) == pytest.approx(1.6 * 2 * 59 - 95.0, abs=4.0)


def test_two_pieces_of_one_person_are_one() -> None:
    steps: list = [[place] for place in walking(20)]
    for k in range(10, 20):
        x, y = steps[k][0]
        steps[k] = [(x, y - 4.0, 6.0, 7.0), (x, y + 5.0, 6.0, 6.0)]
    results = track(steps)
    assert events_of(results, "split")
    assert {label for result in results for label in result.estimate_labels.tolist()} == {1}
    assert results[-1].estimates[0, 3] == pytest.approx(HALF[1], abs=1.0), "the size stands"


def test_without_the_five_cases_there_is_neither_occlusion_nor_return() -> None:
    steps = meeting()
    steps[50:55] = [[]] * 5
    results = track(steps, five_cases=False)
    kinds = {event.kind for result in results for event in result.events}
    assert kinds == {"new", "vanished"}


def test_measurements_can_go_on_instead_of_estimates() -> None:
    steps: list = [[place, (140.0, 20.0 + 7.0 * (k % 9))] for k, place in enumerate(walking(30))]
    changes = {"output": "measurements", "confirmation_steps": 3}
    result = track(steps, **changes)[-1]
    kept = result.boxes[result.labels == 1]
    np.testing.assert_allclose(kept, [(*walking(30)[-1], *HALF)])
    assert len(result.measurements) == 2


@pytest.mark.parametrize("output", ["measurements", "estimates"])
def test_who_is_not_confirmed_is_counted_and_not_reported(output: str) -> None:
    steps: list = [[place, (100.0, 20.0)] for place in walking(3)]
    results = track(steps, output=output, confirmation_steps=9)
    assert [one.information["newcomers"] for one in results] == [2.0] * 3
    for one in results:
        assert not any(map(len, (one.boxes, one.estimates, one.labels, one.gates, one.events)))


def test_the_gate_is_the_quantile_of_its_probability(monkeypatch: pytest.MonkeyPatch) -> None:
    squared, inside = [np.zeros(0)], [np.zeros(0, dtype=bool)]
    original = method.associate

    def associate(found: Innovations, possible: Any, *rest: Any) -> Any:
        squared.append(found.squared.ravel())
        inside.append(possible.ravel())
        return original(found, possible, *rest)

    monkeypatch.setattr(method, "associate", associate)
    steps: list = [[place] for place in walking(15)]
    x, y = steps[-1][0]
    steps[-1] = [(x + 0.5 * k, y) for k in range(60)]
    track(steps, gate_probability=0.9)
    distances, bound = np.concatenate(squared), chi2.ppf(0.9, 2)
    np.testing.assert_array_equal(np.concatenate(inside), distances <= bound)
    ratios = distances / bound
    assert ((ratios > 0.5) & (ratios < 1.0)).any()
    assert ((ratios > 1.0) & (ratios < 2.0)).any()


def test_only_what_the_source_reads_counts() -> None:
    def groups(source: str) -> set[str]:
        chosen = {"single_view": "jpda", "jpda.measurements": source}
        values = stage_values(with_values(RunParameters(), chosen), "single_view")
        return {key.split(".")[0] for key in values}

    assert groups("foreground") == {"single_view", "jpda", "pictures", "foreground"}
    assert groups("colour") == {"single_view", "jpda", "pictures", "foreground", "colour_phd"}
    assert groups("detections") == {"single_view", "jpda", "detection_boxes"}
    chosen = {"single_view": "jpda", "jpda.measurements": "colour"}
    read = stage_values(with_values(RunParameters(), chosen), "single_view")
    assert "colour_phd.bandwidth" in read
    assert "colour_phd.survival_probability" not in read


POSITION = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])


def some_targets(seed: int, count: int) -> Targets:
    """Targets anywhere, with any covariance."""
    rng = np.random.default_rng(seed)
    boxes = np.column_stack([rng.uniform(0, 300, (count, 2)), rng.uniform(2, 20, (count, 2))])
    begun = Targets.at_rest(boxes, np.full((count, 4), 2.0), 5.0, np.arange(1, count + 1))
    factors = rng.normal(0.0, 3.0, (count, 4, 4))
    covariances = factors @ factors.transpose(0, 2, 1) + np.eye(4)
    means = begun.means + rng.normal(0.0, 5.0, (count, 4))
    return replace(begun, means=means, covariances=covariances)


def test_who_begins_stands_still_and_is_unsure_of_it() -> None:
    box = np.array([[40.0, 50.0, 4.0, 9.0]])
    begun = Targets.at_rest(box, np.array([[1.0, 2.0, 3.0, 4.0]]), 5.0, np.array([7]))
    assert_allclose(begun.means, [[40.0, 0.0, 50.0, 0.0]])
    assert_allclose(np.diag(begun.covariances[0]), [1.0, 30.0**2, 4.0, 30.0**2])
    assert_allclose(begun.boxes, box)
    assert begun.hits.tolist() == [1]


@given(st.integers(0, 10_000), st.integers(0, 4))
def test_a_step_ahead_is_filterpys(seed: int, count: int) -> None:
    targets, time, sigma = some_targets(seed, count), 0.04, 8.0
    ahead = targets.predict(time, sigma)
    axis = np.array([[time**3 / 3, time**2 / 2], [time**2 / 2, time]])
    for i in range(count):
        other = KalmanFilter(dim_x=4, dim_z=2)
        other.F = np.kron(np.eye(2), [[1.0, time], [0.0, 1.0]])
        other.x, other.P = targets.means[i], targets.covariances[i]
        other.Q = np.kron(np.eye(2), axis) * sigma**2 * targets.half_sizes[i].prod()
        other.predict()
        assert_allclose(ahead.means[i], other.x)
        assert_allclose(ahead.covariances[i], other.P)


def mixture(targets: Targets, i: int, places: ndarray, sigmas: ndarray, shares: ndarray) -> tuple:
    """Mean and covariance of the miss and of a Kalman update by each measurement."""
    means, covariances = [targets.means[i]], [targets.covariances[i]]
    for place, sigma in zip(places, sigmas, strict=True):
        other = KalmanFilter(dim_x=4, dim_z=2)
        other.x, other.P = targets.means[i], targets.covariances[i]
        other.H, other.R = POSITION, np.diag(sigma**2)
        other.update(place)
        means.append(other.x)
        covariances.append(other.P)
    weights = np.append(1.0 - shares.sum(), shares)
    mean = weights @ np.array(means)
    spread = sum(
        w * (P + np.outer(m - mean, m - mean))
        for w, m, P in zip(weights, means, covariances, strict=True)
    )
    return mean, spread


@given(st.integers(0, 10_000), st.integers(0, 3), st.integers(0, 4))
def test_the_update_keeps_two_moments_of_all_associations(
    seed: int, count: int, measured: int
) -> None:
    rng = np.random.default_rng(seed)
    targets = some_targets(seed, count)
    places, sigmas = rng.uniform(0, 300, (measured, 2)), rng.uniform(0.5, 5.0, (measured, 2))
    shares = rng.dirichlet(np.ones(measured + 1), count)[:, 1:]
    updated = kalman.update(targets, innovations(targets, places, sigmas), shares)
    for i in range(count):
        mean, covariance = mixture(targets, i, places, sigmas, shares[i])
        assert_allclose(updated.means[i], mean, rtol=1e-7, atol=1e-6)
        assert_allclose(updated.covariances[i], covariance, rtol=1e-6, atol=1e-5)


def test_without_any_measurement_the_prediction_stands() -> None:
    targets = some_targets(3, 2)
    found = innovations(targets, np.array([[10.0, 20.0]]), np.ones((1, 2)))
    same = kalman.update(targets, found, np.zeros((2, 1)))
    assert_allclose(same.means, targets.means)
    assert_allclose(same.covariances, targets.covariances)


def test_innovations_are_densities_and_distances() -> None:
    target = Targets.at_rest(
        np.array([[5.0, 5.0, 4.0, 4.0]]), np.full((1, 4), 3.0), 1.0, np.ones(1)
    )
    found = innovations(target, np.array([[10.0, 5.0], [5.0, 5.0]]), np.full((2, 2), 4.0))
    assert_allclose(found.covariances[0, 0], 25.0 * np.eye(2))
    assert_allclose(found.squared, [[1.0, 0.0]])
    assert_allclose(found.densities[0], np.exp([-0.5, 0.0]) / (2.0 * np.pi * 25.0))


def test_as_an_intensity_each_is_one_person() -> None:
    targets = some_targets(5, 3)
    intensity = targets.as_boxes(np.full((3, 4), 2.0))
    assert intensity.cardinality == pytest.approx(3.0)
    assert_allclose(intensity.means, targets.boxes)
    assert_allclose(intensity.covariances[:, 0, 1], targets.covariances[:, 0, 2])
    assert_allclose(intensity.covariances[:, 3, 3], 4.0)


AREA = 90.0 * 60.0
NUMBERS = {"detection_probability": 0.85, "gate_probability": 0.97, "clutter_rate": 1.5}


def some(seed: int, targets: int, measurements: int) -> Innovations:
    """People within a few pixels of each other, and measurements among them."""
    rng = np.random.default_rng(seed)
    boxes = np.column_stack([rng.uniform(20.0, 30.0, (targets, 2)), np.full((targets, 2), 6.0)])
    begun = Targets.at_rest(boxes, np.full((targets, 4), 2.5), 1.0, np.arange(1, targets + 1))
    places = rng.uniform(18.0, 32.0, (measurements, 2))
    return innovations(begun, places, rng.uniform(1.0, 3.0, (measurements, 2)))


def enumerated(
    found: Innovations, possible: ndarray, p: JpdaParams
) -> tuple[ndarray, tuple[int, ...]]:
    """β of all joint events by Bayes' rule, and the likeliest event with any number of false ones.

    Of how many measurements are false the diffuse weight knows nothing: Φ! / V^Φ.
    """
    targets, count = possible.shape
    densities, clutter = found.densities, p.clutter_rate / AREA
    if p.clutter == "diffuse":
        densities = densities * np.sqrt(np.linalg.det(found.covariances))
        clutter = 1.0 / (-2.0 * math.pi * math.log(1.0 - p.gate_probability))
    matrix, total, best = np.zeros((targets, count)), 0.0, (-1.0, ())
    for event in itertools.product(range(-1, count), repeat=targets):
        pairs = [(t, j) for t, j in enumerate(event) if j >= 0]
        if len({j for _, j in pairs}) < len(pairs) or not all(possible[pair] for pair in pairs):
            continue
        false = count - len(pairs)
        weight = clutter**false
        for pair in pairs:
            weight *= p.detection_probability * densities[pair]
        weight *= (1.0 - p.detection_probability * p.gate_probability) ** (targets - len(pairs))
        best = max(best, (weight, event))
        weight *= math.factorial(false) if p.clutter == "diffuse" else 1.0
        total += weight
        for pair in pairs:
            matrix[pair] += weight
    return matrix / total, best[1]


@pytest.mark.parametrize("association", ["exact", "murty"])
@pytest.mark.parametrize("clutter", ["poisson", "diffuse"])
@pytest.mark.parametrize("sizes", [(1, 1), (2, 3), (3, 2), (3, 3)])
def test_the_matrix_is_that_of_all_events(
    association: str, clutter: str, sizes: tuple[int, int]
) -> None:
    p = JpdaParams.model_validate(
        NUMBERS | {"association": association, "clutter": clutter, "events": 200}
    )
    for seed in range(5):
        found = some(seed, *sizes)
        possible = np.ones(sizes, dtype=bool)
        matrix, own = associate(found, possible, AREA, p)
        expected, best = enumerated(found, possible, p)
        assert_allclose(matrix, expected, rtol=1e-6)
        assert tuple(own.tolist()) == best


def test_only_what_lies_in_a_gate_is_associated_and_groups_are_apart() -> None:
    p = JpdaParams.model_validate(NUMBERS | {"association": "exact", "clutter": "poisson"})
    found = some(7, 3, 4)
    possible = np.array([[1, 1, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]], dtype=bool)
    matrix, own = associate(found, possible, AREA, p)
    expected, best = enumerated(found, possible, p)
    assert_allclose(matrix, expected, rtol=1e-6)
    assert tuple(own.tolist()) == best
    assert_array_equal(matrix > 0.0, possible)
    # of the diffuse weight the false measurements of a group are its own alone
    p = JpdaParams.model_validate(NUMBERS | {"association": "exact", "clutter": "diffuse"})
    matrix, _ = associate(found, possible, AREA, p)
    alone = Innovations(*(getattr(found, name)[2:, 2:3] for name in (
        "offsets", "covariances", "precisions", "squared", "densities")))  # fmt: skip
    assert_allclose(matrix[2, 2], enumerated(alone, possible[2:, 2:3], p)[0][0, 0])
    nobody, own = associate(some(1, 0, 3), np.zeros((0, 3), dtype=bool), AREA, p)
    assert nobody.shape == (0, 3)
    assert own.shape == (0,)
    nothing, own = associate(some(1, 2, 0), np.zeros((2, 0), dtype=bool), AREA, p)
    assert nothing.shape == (2, 0)
    assert own.tolist() == [-1, -1]


def test_a_density_that_vanishes_leaves_the_pair_possible() -> None:
    p = JpdaParams.model_validate(NUMBERS | {"association": "exact"})
    far = some(2, 1, 1)
    none = Innovations(far.offsets, far.covariances, far.precisions, far.squared, 0.0 * far.squared)
    matrix, own = associate(none, np.ones((1, 1), dtype=bool), AREA, p)
    assert 0.0 < matrix[0, 0] < 1e-250
    assert own.tolist() == [-1]


@pytest.mark.parametrize("association", ["exact", "simplified_murty"])
def test_larger_groups_are_associated_too(association: str) -> None:
    """Beyond what is enumerated exactly: rows of probabilities, and each measurement once."""
    p = JpdaParams.model_validate(NUMBERS | {"association": association, "clutter": "poisson"})
    for count in (3, 20):
        found = some(5, count, count)
        matrix, own = associate(found, np.ones((count, count), dtype=bool), AREA, p)
        assert (matrix >= 0.0).all()
        assert (matrix.sum(axis=1) <= 1.0 + 1e-9).all()
        assert (matrix.sum(axis=0) <= 1.0 + 1e-6).all()
        taken = own[own >= 0]
        assert len(set(taken.tolist())) == len(taken) > 0


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
    ("the likeliest event", [[0.4, 0.5], [0.0, 0.4]], [0, 1], [-1, -1], [1, 0], [0, 0], [0, 0]),
    ("occluded in two", [[0.5, 0.3], [0.45, 0.0]], [0, -1], [0, 0], [0, 0], [0, 0], [0, 0]),
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
    # the second target's centre lies in the piece that the first one has, alone or with another
    for shares in ([[0.9], [0.0]], [[0.6, 0.35], [0.0, 0.0]]):
        cases = read(shares, [0, -1])
        found = search_components(
            cases,
            boxes((100, 100, 10, 20), (116, 98, 10, 20)),
            boxes((100, 100, 10, 20), (100, 160, 10, 9))[: len(shares[0])],
            boxes((108, 100, 18, 22), (100, 160, 10, 9))[: len(shares[0])],
            LEAP,
        )
        assert_array_equal(found.shared, [0, 0])
        assert not found.missed.any()
        assert not found.split.any()


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


HALF_SIZES = (4.0, 9.0)


def targets(*places: tuple[float, float], speeds: tuple[float, float] = (0.0, 0.0)) -> Targets:
    """People of one size and one velocity."""
    boxes = np.array([[*place, *HALF_SIZES] for place in places])
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
    front, piece = (100.0, 100.0, *HALF_SIZES), (97.5, 103.0, 6.5, 12.0)
    some, seen = targets((100, 100), (99, 102)), measured([front], [piece])
    for _ in range(8):
        some = moved(some, seen, [[1.0], [0.0]], [0, -1], [0, 0]).targets
    assert_allclose(some.positions, [[100.0, 100.0], [95.0, 106.0]], atol=0.4)


def test_who_is_hidden_never_leaves_the_piece() -> None:
    some = targets((100, 100), (99, 100), speeds=(200.0, -100.0))
    seen = measured([(100.0, 100.0, *HALF_SIZES)], [(101.0, 101.0, 6.0, 11.0)])
    result = moved(some.predict(0.2, 8.0), seen, [[1.0], [0.0]], [0, -1], [0, 0])
    inside = np.abs(result.targets.positions[1] - [101.0, 101.0])
    assert (inside <= [2.0 + 1e-9, 2.0 + 1e-9]).all()
    assert_array_equal(result.hidden, [False, True])


def test_two_hidden_in_one_piece_leave_its_edges_open() -> None:
    some = targets((100, 100), (99, 100), (98, 101))
    seen = measured([(100.0, 100.0, *HALF_SIZES)], [(97.5, 103.0, 6.5, 12.0)])
    result = moved(some, seen, [[1.0], [0.0], [0.0]], [0, -1, -1], [0, 0, 0])
    assert_allclose(result.targets.positions[1:], some.positions[1:], atol=0.01)


EDGES: list[tuple[str, tuple[float, ...], list[tuple[float, ...]], list[int]]] = [
    ("left and below", (97.5, 103, 6.5, 12), [(100, 100, *HALF_SIZES)], [-1, 1]),
    ("nothing", (100, 100, *HALF_SIZES), [(100, 100, *HALF_SIZES)], [0, 0]),
    ("both sides", (100, 100, 9, 9), [(100, 100, *HALF_SIZES)], [0, 0]),
    ("legs of somebody tall", (100, 130, 4, 39), [(100, 100, *HALF_SIZES)], [0, 0]),
    ("two in front", (103, 100, 8, 9), [(99, 100, *HALF_SIZES), (104, 100, *HALF_SIZES)], [1, 0]),
]


@pytest.mark.parametrize(
    ("piece", "shown", "edges"), [row[1:] for row in EDGES], ids=[row[0] for row in EDGES]
)
def test_which_edges_are_left_over(
    piece: tuple[float, ...], shown: list[tuple[float, ...]], edges: list[int]
) -> None:
    boxes: ndarray = np.array(shown, dtype=float)
    found = _left_over(
        np.array(piece, dtype=float), boxes, np.array(HALF_SIZES), JpdaParams().one_side
    )
    assert_array_equal(found, edges)


def test_of_two_measurements_that_both_may_have_made_each_takes_its_own() -> None:
    some = targets((100, 100), (103, 100))
    seen = measured(
        [(98.0, 100.0, *HALF_SIZES), (105.0, 100.0, *HALF_SIZES)], [(98.0, 100.0, *HALF_SIZES)] * 2
    )
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
    rows = [(100.0, 100.0, 6.0, 12.0), (300.0, 100.0, 6.0, 12.0), (400.0, 100.0, *HALF_SIZES)]
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
    expected = np.tile(HALF_SIZES, (5, 1))
    expected[0] += 0.25 * 0.8 * (np.array([6.0, 12.0]) - HALF_SIZES)
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
    seen = measured(
        [(100.0, 100.0, *np.multiply(HALF_SIZES, factors))], [(100.0, 100.0, 9.0, 12.0)]
    )
    result = moved(some, seen, [[1.0]], [0], [0], JpdaParams(same_size=1.5))
    assert result.hidden.tolist() == [not alike]


CROWN_NUMBERS = JpdaParams()

HALF_EXTENTS = np.array([0.17, 0.17, 0.36])
"""Head and torso."""
CAMERA = CAMERAS[0]


@pytest.fixture(scope="module")
def sizes() -> TargetSizes:
    return TargetSizes(CAMERA, ROOM, HALF_EXTENTS, CROWN_NUMBERS.height_sigmas)


def standing(*places: tuple[float, float], height: float = 1.0) -> tuple[ndarray, ndarray]:
    """The mask of people on the floor, all of them, and the boxes of their heads and torsos."""
    positions = np.array([(x, y, height) for x, y in places])
    boxes, seen = upright_boxes(CAMERA, positions, HALF_EXTENTS)
    assert seen.all()
    mask = np.zeros(CAMERA.image_size[::-1], dtype=np.uint8)
    for x, y, half_x, half_y in boxes:
        neck = y - 0.5 * half_y
        cv2.ellipse(mask, (round(x), round(y - 0.62 * half_y)),
                    (round(0.5 * half_x), round(0.38 * half_y)), 0, 0, 360, 1, -1)  # fmt: skip
        cv2.rectangle(mask, (round(x - 0.9 * half_x), round(neck)),
                      (round(x + 0.9 * half_x), round(y + 2.4 * half_y)), 1, -1)  # fmt: skip
    return mask, boxes


def compare(found: ndarray, boxes: ndarray) -> None:
    """Every person once, nobody else."""
    assert len(found) == len(boxes)
    for box in boxes:
        apart = np.abs((found[:, :2] - box[:2]) / box[2:]).max(axis=1)
        nearest = found[apart.argmin()]
        assert apart.min() < 0.35
        np.testing.assert_allclose(nearest[2:] / box[2:], 1.0, atol=0.25)


def test_one_person_is_found_from_the_crown_down(sizes: TargetSizes) -> None:
    for place in ((0.0, 0.0), (-0.8, 0.6), (0.9, -0.4)):
        mask, boxes = standing(place)
        found = crowns(mask, sizes, 40, CROWN_NUMBERS)
        compare(found.boxes, boxes)
        assert found.inside[0] > 0.6
        assert found.pieces[0, 3] > 1.5 * found.boxes[0, 3], "the piece shows the legs too"


def test_two_in_one_piece_are_two(sizes: TargetSizes) -> None:
    mask, boxes = standing((-0.1, 0.1), (0.12, -0.12))
    assert cv2.connectedComponents(mask)[0] == 2, "one piece, and the background"
    compare(crowns(mask, sizes, 40, CROWN_NUMBERS).boxes, boxes)


def test_a_crack_across_a_person_makes_nobody_new(sizes: TargetSizes) -> None:
    mask, boxes = standing((0.0, 0.0))
    row = round(boxes[0, 1] - 0.45 * boxes[0, 3])
    mask[row : row + 3] = 0
    compare(crowns(mask, sizes, 40, CROWN_NUMBERS).boxes, boxes)


def test_what_is_higher_than_people_come_in_is_nobody() -> None:
    walked = TargetSizes(CAMERA, ROOM, HALF_EXTENTS, CROWN_NUMBERS.height_sigmas)
    anything = TargetSizes(
        CAMERA, Room(ROOM.minimum, ROOM.maximum), HALF_EXTENTS, CROWN_NUMBERS.height_sigmas
    )
    mask, _ = standing((1.3, 1.3), height=1.85)  # the entrances are at 1 m, give or take 0.15
    assert len(crowns(mask, anything, 40, CROWN_NUMBERS).boxes) == 1
    assert len(crowns(mask, walked, 40, CROWN_NUMBERS).boxes) == 0


@pytest.mark.parametrize("filled", [False, True])
def test_an_empty_mask_and_a_full_one_show_nobody(sizes: TargetSizes, filled: bool) -> None:
    mask = np.full(CAMERA.image_size[::-1], filled, dtype=np.uint8)
    found = crowns(mask, sizes, 40, CROWN_NUMBERS)
    assert found.boxes.shape == (0, 4)
    assert found.pieces.shape == (0, 4)


def body(width: float) -> tuple[ndarray, ndarray]:
    """The mask of a standing person whose parts are ``width`` times as wide, and the whole box."""
    whole = np.array([0.3, 0.3, 0.85])
    boxes, seen = upright_boxes(CAMERA, np.array([[0.0, 0.0, 0.85]]), whole)
    assert seen.all()
    (x, y, half_x, half_y), mask = boxes[0], np.zeros(CAMERA.image_size[::-1], dtype=np.uint8)
    pixels = half_x / 0.3  # per metre
    for top, bottom, across in ((0.0, 0.13, 0.17), (0.13, 0.47, 0.32), (0.47, 1.0, 0.18)):
        rows = [round(y + (2.0 * share - 1.0) * half_y) for share in (top, bottom)]
        half = max(0.5, width * across * pixels / 2.0)
        cv2.rectangle(mask, (round(x - half), rows[0]), (round(x + half), rows[1]), 1, -1)
    return mask, boxes


@pytest.mark.parametrize("entrances", [True, False])
def test_a_whole_body_need_not_fill_its_box_but_its_outline(entrances: bool) -> None:
    doors = world.volume(1.5, 2.0, [(0.0, 1.4, 0.85)], (0.25, 0.25, 0.05)).entrances
    room = Room(ROOM.minimum, ROOM.maximum, doors if entrances else ())
    sizes = TargetSizes(CAMERA, room, np.array([0.3, 0.3, 0.85]), CROWN_NUMBERS.height_sigmas)
    mask, boxes = body(1.0)
    found = crowns(mask, sizes, 40, CROWN_NUMBERS)
    compare(found.boxes, boxes)
    assert found.inside[0] > 0.7
    slim, _ = body(0.75)  # seen from the side
    assert len(crowns(slim, sizes, 40, CROWN_NUMBERS).boxes) == 1
    pole, _ = body(0.2)
    assert len(crowns(pole, sizes, 10, CROWN_NUMBERS).boxes) == 0
