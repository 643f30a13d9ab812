"""The association matrix against all joint events, written down one by one."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from numpy import ndarray
from numpy.testing import assert_allclose, assert_array_equal

from tracker.parameters.groups.jpda import JpdaParams
from tracker.single_view.jpda.method import associate
from tracker.single_view.jpda.targets import Innovations, Targets, innovations

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
