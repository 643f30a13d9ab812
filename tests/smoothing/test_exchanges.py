"""Exchanged tracks are found by both paths as a whole, and split where they were exchanged."""

from __future__ import annotations

import numpy as np
import pytest
from numpy import ndarray
from scipy.stats import multivariate_normal

from tests.smoothing.known import STEP, fitted_to, measured
from tracker.smoothing.smoother import Fitted
from tracker.smoothing.tracklets.motion import (
    _best_of_encounters,
    exchange_breaks,
    exchange_log_odds,
    find_exchange,
)

SIGMA = 0.05


def fitted(places: list[ndarray]) -> Fitted:
    """Paths of people measured at some places, (T, 3) metres each."""
    paths, smooth = measured(places, SIGMA)
    as_stated = np.ones(len(paths.states))
    return fitted_to(paths, smooth(as_stated), as_stated)


def two(steps: int, turn: int) -> list[ndarray]:
    """Two who cross at right angles, each going on as the other from a step on."""
    rng = np.random.default_rng(4)
    away = (np.arange(steps) - turn + 0.5) * STEP * 1.2
    one = np.stack([away, np.zeros(steps), np.ones(steps)], axis=1)
    other = np.stack([np.full(steps, 0.2), away, np.ones(steps)], axis=1)
    one[turn:], other[turn:] = (
        other[turn:].copy(),
        one[turn:].copy(),
    )
    return [own + rng.normal(0.0, SIGMA, own.shape) for own in (one, other)]


@pytest.mark.parametrize("turn", [6, 10, 14])
def test_both_are_cut_where_they_turned_into_each_other(turn: int) -> None:
    found = exchange_breaks(fitted(two(20, turn)), reach=2.5, least=0.0, apart=4)
    assert np.flatnonzero(found).tolist() == [turn, 20 + turn]


@pytest.mark.parametrize("crossed", [6, 10, 14])
def test_who_is_said_to_be_the_other_later_turned_where_both_lives_fit(crossed: int) -> None:
    paths = fitted(two(20, crossed))
    assert find_exchange(paths, 0, 1, crossed - 5, crossed + 4) == [crossed, 20 + crossed]
    assert find_exchange(paths, 0, 1, 18, 30) == [19, 39]
    assert find_exchange(paths, 0, 1, 19, 30) == []
    assert find_exchange(paths, 0, 1, -5, 0) == [], "nobody turns before the own second step"
    assert find_exchange(paths, 0, 1, -5, 1) == [1, 21]


def test_who_goes_straight_on_is_not_cut() -> None:
    right = two(20, 10)
    right[0][10:], right[1][10:] = right[1][10:].copy(), right[0][10:].copy()
    assert not exchange_breaks(fitted(right), reach=2.5, least=-2.0, apart=4).any()


def test_the_order_of_paths_changes_nothing() -> None:
    places = two(20, 10)
    one = exchange_breaks(fitted(places), reach=2.5, least=0.0, apart=4)
    other = exchange_breaks(fitted(places[::-1]), reach=2.5, least=0.0, apart=4)
    assert one.tolist() == [*other[20:], *other[:20]]


def test_nobody_and_one_alone_have_nothing_to_exchange() -> None:
    assert not len(exchange_breaks(fitted([]), reach=2.5, least=0.0, apart=4))
    assert not exchange_breaks(fitted(two(20, 10)[:1]), reach=2.5, least=0.0, apart=4).any()


def test_what_an_exchange_gains_is_by_the_integrals_and_the_same_from_either_side() -> None:
    """ℓ by the densities: what the rows from one on say is N(y; x, Λ⁻¹) up to a constant, which
    both ways have alike."""
    paths = fitted(two(20, 10))
    one, other = np.array([6, 10, 13]), np.array([26, 30, 33])
    found = exchange_log_odds(paths, one, other)
    assert found == pytest.approx(exchange_log_odds(paths, other, one))
    states, spread = paths.paths.states, paths.paths.covariances

    def fits(before: int, after: int) -> float:
        ahead = paths.ahead_covariances[after]
        information = np.linalg.inv(spread[after]) - np.linalg.inv(ahead)
        noise = np.linalg.pinv(information, 1e-7)
        told = np.linalg.solve(spread[after], states[after])
        told -= np.linalg.solve(ahead, paths.ahead[after])
        return float(
            multivariate_normal(
                paths.ahead[before], paths.ahead_covariances[before] + noise, allow_singular=True
            ).logpdf(noise @ told)
        )

    for gain, i, j in zip(found, one.tolist(), other.tolist(), strict=True):
        by_hand = fits(i, j) + fits(j, i) - fits(i, i) - fits(j, j)
        assert gain == pytest.approx(by_hand, rel=1e-3, abs=1e-3)
    assert found[1] > max(found[0], found[2])


def test_only_who_come_near_each_other_are_exchanged() -> None:
    """By where the rows before have them, at the step of the exchange."""
    paths = fitted(two(20, 10))
    apart = np.hypot(*(paths.ahead[:20, :2] - paths.ahead[20:, :2]).T)
    nearest = apart[1:].min()
    for reach, cut in ((nearest - 1e-6, False), (apart[10] + 1e-6, True)):
        assert exchange_breaks(paths, reach=reach, least=-1e6, apart=40).any() == cut


@pytest.mark.parametrize(("least", "cut"), [(-1e-6, True), (1e-6, False)])
def test_both_are_cut_from_the_least_odds_on(least: float, cut: bool) -> None:
    paths = fitted(two(20, 10))
    most = exchange_log_odds(paths, np.array([10]), np.array([30]))[0]
    found = exchange_breaks(paths, reach=2.5, least=most + least, apart=40)
    assert found.any() == cut


@pytest.mark.parametrize(("last", "rows"), [(7, [1]), (8, [1, 2])])
def test_two_who_are_apart_for_longer_meet_anew(last: int, rows: list[int]) -> None:
    one, other = np.array([0, 1, 0]), np.array([1, 0, 1])
    gains = np.array([1.0, 5.0, 4.0])
    assert _best_of_encounters(one, other, np.array([2, 3, last]), gains, 4) == rows


def test_encounters_are_of_the_same_two() -> None:
    one, other = np.array([0, 0, 1]), np.array([1, 2, 2])
    assert _best_of_encounters(one, other, np.array([2, 3, 4]), np.ones(3), 4) == [0, 1, 2]
