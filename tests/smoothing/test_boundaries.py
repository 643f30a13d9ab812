"""Thresholds of the smoothing at, one below and one above, and links by integration."""

from __future__ import annotations

import numpy as np
import pytest
from numpy import ndarray
from numpy.testing import assert_allclose
from scipy.stats import multivariate_normal

from tracker.corrections.constraints import Constraints
from tracker.filters.models import Motion
from tracker.parameters.groups.fusion import FusionParams
from tracker.smoothing.lifetimes import independent_share
from tracker.smoothing.paths import Paths, same_label
from tracker.smoothing.smoother import Fitted
from tracker.smoothing.tracklets.constraints import (
    combine_constraints,
    existence_spans,
    split_by_gap,
)
from tracker.smoothing.tracklets.motion import Ends, Pairs, log_integral, motion_gains, near_pairs

PRIOR = np.diag([100.0] * 3 + [0.49] * 3)


def standing(*pieces: tuple[int, int, int, float]) -> Paths:
    """Label, first step, last step and x of each piece."""
    states, spread = [], []
    for _, first, last, x in pieces:
        state = np.zeros((last - first + 1, 6))
        state[:, 0], state[:, 2] = x, 0.85
        states.append(state)
        spread.append(np.tile(np.diag([0.01, 0.01, 0.01, 0.1, 0.1, 0.1]), (len(state), 1, 1)))
    labels, firsts = [p[0] for p in pieces], [p[1] for p in pieces]
    return Paths.of(labels, firsts, states, spread, 6)


def fitted(paths: Paths, noise_scales: ndarray | float = 1.0) -> Fitted:
    """Paths that are fitted already."""
    rows = len(paths.states)
    scales = np.broadcast_to(noise_scales, rows).astype(float)
    return Fitted(paths, np.zeros(rows), paths.states, paths.covariances, np.zeros(rows), scales)


def pairs_of(found: Pairs) -> list[tuple[int, int]]:
    return list(zip(found.earlier.tolist(), found.later.tolist(), strict=True))


# ── which pieces may be linked


@pytest.mark.parametrize(
    ("first", "linked"), [(4, False), (5, True), (6, True), (14, True), (15, False)]
)
def test_a_gap_is_at_least_a_step_and_at_most_the_longest(first: int, linked: bool) -> None:
    found = near_pairs(standing((1, 0, 4, 0.0), (2, first, 20, 0.0)), longest=10, fastest=0.3)
    # a gap of one step is no gap: the later piece begins at the next step
    assert pairs_of(found) == ([(0, 1)] if linked and first > 4 else [])
    assert found.gaps.tolist() == ([first - 4] if linked else [])


@pytest.mark.parametrize(("x", "linked"), [(2.5, True), (2.5 + 1e-9, False)])
def test_nobody_goes_farther_than_a_metre_and_what_the_fastest_does(x: float, linked: bool) -> None:
    paths = standing((1, 0, 4, 0.0), (2, 7, 9, x))
    assert pairs_of(near_pairs(paths, longest=10, fastest=0.5)) == ([(0, 1)] if linked else [])
    same = standing((1, 0, 4, 0.0), (1, 7, 9, 99.0))
    assert pairs_of(near_pairs(same, longest=10, fastest=0.5)) == [(0, 1)]


def test_a_piece_goes_on_under_its_label_as_the_next_that_does_not_overlap() -> None:
    paths = standing((2, 5, 9, 0), (1, 0, 3, 0), (2, 0, 4, 0), (1, 3, 6, 0), (1, 7, 8, 0))
    assert sorted(same_label(paths)) == [(2, 0), (3, 4)]


@pytest.mark.parametrize(("gap", "near"), [(10, True), (11, False)])
def test_a_constraint_over_the_longest_gap_is_one_over_a_short_gap(gap: int, near: bool) -> None:
    cut = standing((1, 0, 4, 0.0), (2, 4 + gap, 30, 0.0))
    now, later = split_by_gap(Constraints(must_link=((0, 1),), cannot_link=((0, 1),)), cut, 10)
    assert now.must_link == (((0, 1),) if near else ())
    assert later.must_link == (() if near else ((0, 1),))
    assert now.cannot_link == later.cannot_link == ((0, 1),)


def test_pieces_of_one_person_follow_one_another() -> None:
    firsts = np.array([0, 5, 6])
    for last, together in ((4, ((0, 1),)), (5, ())):
        found = combine_constraints(firsts, np.array([last, 8, 9]), [Constraints(((0, 1),))])
        assert found is not None
        assert found.must_link == together
    assert (
        combine_constraints(firsts, np.array([5, 8, 9]), [Constraints(((0, 1),))], strict=True)
        is None
    )


def test_who_is_not_somebody_else_ends_before_that_one_begins() -> None:
    cut = standing((1, 0, 4, 0.0), (2, 8, 9, 0.0), (3, 2, 6, 0.0))
    apart = Constraints(cannot_link=((1, 0), (0, 2)))
    assert existence_spans(apart, [[0], [1], [2]], cut) == {
        0: (0, 7), 1: (5, int(np.iinfo(np.int64).max))
    }  # fmt: skip
    # two who are both there at a step limit nothing
    shared = standing((1, 0, 4, 0.0), (2, 4, 9, 0.0))
    assert existence_spans(Constraints(cannot_link=((0, 1),)), [[0], [1]], shared) == {}
    own = Constraints(firsts=frozenset({1}), lasts=frozenset({0}))
    assert existence_spans(own, [[0], [1]], cut)[0] == (0, 4)
    assert existence_spans(own, [[0], [1]], cut)[1][0] == 8
    assert existence_spans(own, [[0, 1]], cut) == {0: (0, int(np.iinfo(np.int64).max))}


# ── what a link is worth


def test_the_log_integral_is_the_integral() -> None:
    rng = np.random.default_rng(3)
    for _ in range(5):
        root, told = rng.normal(size=(2, 3, 3))
        mean, vector = rng.normal(size=(2, 3))
        covariance, information = root @ root.T + 0.1 * np.eye(3), 0.3 * told @ told.T
        found = log_integral(mean[None], covariance[None], information[None], vector[None])[0]
        # of what is N(y; x, Λ⁻¹) up to a constant it is N(y; m, P + Λ⁻¹)
        inverse = np.linalg.inv(information)
        y = inverse @ vector
        constant = 0.5 * y @ vector + 0.5 * np.linalg.slogdet(2.0 * np.pi * inverse)[1]
        assert found == pytest.approx(
            multivariate_normal(mean, covariance + inverse).logpdf(y) + constant, abs=1e-6
        )


def test_a_link_is_worth_as_much_as_its_motion_is_likelier_than_a_newcomer() -> None:
    """By the densities themselves: two ends known as Gaussians, over a gap of three steps, as
    restless as the one is at its end and the other at its beginning."""
    motion = Motion.of(FusionParams(), 0.1)
    paths = standing((1, 0, 4, 0.0), (2, 7, 9, 0.4))
    scales = np.array([9.0, 1.0, 1.0, 1.0, 0.04, 0.25, 1.0, 9.0])
    known = Ends.alone(fitted(paths, scales), PRIOR)
    assert_allclose(known.noise_scales, [[9.0, 0.04], [0.25, 9.0]])
    pair = Pairs(np.array([0]), np.array([1]), np.array([3]), np.zeros(1))
    found = motion_gains(paths, pair, known, motion, PRIOR, 1.5)[0]
    f, q = np.eye(6), np.zeros((6, 6))
    for _ in range(3):
        f, q = motion.transition @ f, motion.transition @ q @ motion.transition.T + motion.noise
    told = known.information[1:], known.vectors[1:]
    ahead, spread = f @ paths.states[4], f @ paths.covariances[4] @ f.T
    ways = [
        np.log(weight) + log_integral(ahead[None], (spread + s * q)[None], *told)[0]
        for weight, s in ((0.9, np.sqrt(0.04 * 0.25)), (0.1, 1.0))
    ]
    newcomer = log_integral(paths.states[5][None], PRIOR[None], *told)[0]
    assert found == pytest.approx(np.logaddexp(*ways) - newcomer - 1.5, abs=1e-8)


def test_the_first_pieces_own_prior_is_not_evidence() -> None:
    """Ends.alone: the information of a piece is its posterior's less the prior's."""
    paths = standing((1, 0, 4, 0.7))
    known = Ends.alone(fitted(paths), PRIOR)
    total = known.information[0] + np.linalg.inv(PRIOR)
    assert_allclose(np.linalg.inv(total), paths.covariances[0], atol=1e-9)
    centre = np.array([0.7, 0.0, 0.85, 0.0, 0.0, 0.0])
    mean = np.linalg.solve(total, known.vectors[0] + np.linalg.solve(PRIOR, centre))
    assert_allclose(mean, paths.states[0], atol=1e-9)
    half = known.discounted(0.5)
    assert_allclose(half.covariances, 2.0 * known.covariances)
    assert_allclose(half.information, 0.5 * known.information)
    assert_allclose(half.vectors, 0.5 * known.vectors)


@pytest.mark.parametrize(
    ("step_time", "memory", "share"), [(0.1, 0.25, 0.4), (0.25, 0.25, 1.0), (0.5, 0.25, 1.0)]
)
def test_the_share_of_new_evidence_is_a_steps_time_over_the_memory(
    step_time: float, memory: float, share: float
) -> None:
    assert independent_share(step_time, memory) == pytest.approx(share)
