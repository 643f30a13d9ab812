"""The order of the cameras in the plain PHD recursion, and with one target for each label."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy import ndarray
from numpy.testing import assert_array_equal

from tracker.filters import phd
from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.filters.phd import PhdUpdate
from tracker.fusion import sequential_phd
from tracker.kernels.kalman import Expected

R = 0.04 * np.eye(2)
NO_BIRTHS = range(900, 900)
CLUTTER = 1e-6


def mixture(weights: list[float], means: list[list[float]], labels: list[int]) -> GaussianMixture:
    """Components of the same spread in the plane."""
    covariances = np.tile(0.09 * np.eye(2), (len(weights), 1, 1))
    return GaussianMixture(
        np.array(weights), np.array(means, dtype=float), covariances, np.array(labels)
    )


def plain(
    before: GaussianMixture, boxes: ndarray, p_d: float, clutter: float = CLUTTER
) -> PhdUpdate:
    """The recursion of [VM06] with one linear camera."""
    return phd.update(
        before,
        boxes,
        expected=Expected.of(before.means, np.tile(np.eye(2), (before.size, 1, 1))),
        noise=R[None],
        detection_probability=p_d,
        clutter_intensity=clutter,
        gate=25.0,
    )


def shared(
    before: GaussianMixture,
    boxes: ndarray,
    p_d: float,
    births: range = NO_BIRTHS,
    clutter: float = CLUTTER,
) -> PhdUpdate:
    """The same with one person a label."""
    return sequential_phd.associate_labels(
        before,
        plain(before, boxes, p_d, clutter),
        np.full(before.size, p_d),
        births=births,
        next_label=1000,
    )


def weight_after(order: list[tuple[float, bool]], *, per_person: bool) -> float:
    """Weight of one sure target after cameras of some p_D that hit or miss it, in that order."""
    state = mixture([1.0 if not per_person else 0.999], [[0.0, 0.0]], [1])
    update = shared if per_person else plain
    for p_d, hit in order:
        boxes = state.means[:1] if hit else np.zeros((0, 2))
        after = update(state, boxes, p_d).posterior
        heavy = after.weights > 1e-9
        state = after.take(heavy)
    return state.cardinality


GOOD, POOR = (0.95, True), (0.5, False)


def test_the_plain_recursion_depends_on_the_order_of_the_cameras() -> None:
    # camera A with p_D 0.95 and B with 0.5, as a target that one of them misses feels it
    assert weight_after([GOOD, POOR], per_person=False) == pytest.approx(0.52, abs=0.01)
    assert weight_after([POOR, GOOD], per_person=False) == pytest.approx(1.02, abs=0.01)
    hit_by_poor, missed_by_good = (0.5, True), (0.95, False)
    assert weight_after([hit_by_poor, missed_by_good], per_person=False) == pytest.approx(
        0.075, abs=0.005
    )


@given(st.lists(st.tuples(st.floats(0.1, 0.95), st.booleans()), min_size=2, max_size=4))
def test_one_person_a_label_asks_for_no_order(cameras: list[tuple[float, bool]]) -> None:
    weights = [
        weight_after(list(order), per_person=True) for order in itertools.permutations(cameras)
    ]
    assert max(weights) - min(weights) < 1e-3
    if any(hit for _, hit in cameras):
        assert min(weights) > 0.99


def test_a_label_is_never_more_than_one_person() -> None:
    # two boxes that one component could have made, each by itself
    before = mixture([0.99], [[0.0, 0.0]], [7])
    boxes = np.array([[0.1, 0.0], [-0.1, 0.0]])
    assert plain(before, boxes, 0.98).posterior.cardinality > 1.9
    after = shared(before, boxes, 0.98)
    assert after.posterior.cardinality <= 1.0 + 1e-9
    assert_array_equal(after.posterior.labels, [7, 7, 7])
    assert after.measurement_weights.sum() <= 1.0 + 1e-9


def test_a_newcomer_gets_a_label_of_its_box() -> None:
    # a birth that covers all of the plane, and two boxes far from each other
    births = GaussianMixture(
        np.array([0.1]), np.zeros((1, 2)), 4.0 * np.eye(2)[None], np.array([50])
    )
    boxes = np.array([[-2.0, 0.0], [2.0, 0.0]])
    after = shared(births, boxes, 0.98, births=range(50, 51)).posterior
    assert_array_equal(after.labels, [50, 1000, 1001])
    assert (after.weights[1:] > 0.99).all()
    assert after.weights[0] == pytest.approx(0.1 * 0.02), "what was not seen stays Poisson"


def test_nobody_and_nothing() -> None:
    nobody = GaussianMixture.empty(2)
    assert shared(nobody, np.zeros((0, 2)), 0.9).posterior.size == 0
    assert_array_equal(shared(nobody, np.zeros((3, 2)), 0.9).measurement_weights, np.zeros(3))
    alone = mixture([0.5], [[0.0, 0.0]], [1])
    after = shared(alone, np.zeros((0, 2)), 0.9)
    assert after.posterior.weights[0] == pytest.approx(0.5 * 0.1 / (1 - 0.45))


@pytest.mark.parametrize("clutter", [1.0, 1e-6, 1e-16, 1e-20, 1e-300, 5e-324])
def test_however_little_clutter_there_is_a_box_is_shared_by_its_odds(clutter: float) -> None:
    before = mixture([0.5], [[0.0, 0.0]], [1])
    after = shared(before, before.means, 0.9, clutter=clutter).posterior
    hit = np.exp(np.log(0.45 / (2.0 * np.pi * 0.13)) - np.log(clutter).clip(min=-600.0))
    assert after.cardinality == pytest.approx((hit + 0.05) / (hit + 0.55))


def test_sure_people_are_merged_with_nobody_else() -> None:
    people = mixture([0.4, 0.4, 0.3, 0.9], [[0.0, 0.0]] * 4, [1, 1, 2, 3])
    assert_array_equal(sequential_phd.merging_owners(people), [1, 1, -1, 3])
