"""Tracklets linked under constraints: the optimum of all links that satisfy them."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from numpy import ndarray

from tests.smoothing.test_linking import chains, graph_of, value_of, worth_of
from tracker.corrections.constraints import Constraints
from tracker.smoothing.tracklets.constraints import combine_constraints
from tracker.smoothing.tracklets.solver import TrackletGraph, link_tracklets


def obeys(following: tuple[int, ...], used: tuple[bool, ...], constraints: Constraints) -> bool:
    """Whether chains are as constraints want them."""
    of = {piece: number for number, chain in enumerate(chains(following, used)) for piece in chain}
    followed = {j for j in following if j >= 0}
    direct = {(i, j) for i, j in enumerate(following) if j >= 0}
    tied = set(constraints.must_link)
    return (
        all(i in of and of[i] == of.get(j) for i, j in constraints.must_link)
        and all(of.get(i, -1) != of.get(j, -2) for i, j in constraints.cannot_link)
        and all(piece in of for piece in constraints.targets)
        and not any(piece in of for piece in constraints.clutter)
        and all(
            p not in followed or any((i, p) in tied for i, j in direct if j == p)
            for p in constraints.firsts
        )
        and all(following[p] < 0 or (p, following[p]) in tied for p in constraints.lasts)
    )


def drawn_ties(rng: np.random.Generator, count: int) -> Constraints:
    """Some that can be obeyed: pieces begin one after another."""
    firsts = np.arange(count) * 10
    lasts = firsts + rng.integers(1, 9, count)

    def pairs() -> list[tuple[int, int]]:
        pair = sorted(rng.choice(count, 2, replace=False).tolist())
        return [(pair[0], pair[1])] if rng.random() < 0.6 else []

    told = [
        Constraints(
            pairs(),
            pairs(),
            clutter=frozenset({int(rng.integers(count))} if rng.random() < 0.2 else ()),
            firsts=frozenset({int(rng.integers(count))} if rng.random() < 0.1 else ()),
            lasts=frozenset({int(rng.integers(count))} if rng.random() < 0.1 else ()),
        )
        for _ in range(3)
    ]
    found = combine_constraints(firsts, lasts, told)
    assert found is not None
    return found


@pytest.mark.parametrize("seed", range(60))
def test_the_best_of_all_ways_that_obey(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 6))
    numbers = {
        "worths": rng.normal(2.0, 6.0, count),
        "births": rng.normal(-4.0, 1.0, count),
        "deaths": rng.normal(-4.0, 1.0, count),
    }
    gain: ndarray = np.where(
        np.triu(rng.random((count, count)) < 0.8, 1), rng.normal(-3.0, 5.0, (count, count)), -np.inf
    )
    constraints = drawn_ties(rng, count)
    found = link_tracklets(graph_of(numbers, gain), constraints)
    for i, j in constraints.must_link:  # what no pair connects may be, with no odds of its own
        if not np.isfinite(gain[i, j]):
            gain[i, j] = numbers["deaths"][i] + numbers["births"][j]
    best = max(
        worth_of(one, there, numbers, gain)
        for one in itertools.product(*([-1, *range(i + 1, count)] for i in range(count)))
        for there in itertools.product((False, True), repeat=count)
        if len({j for j in one if j >= 0}) == sum(j >= 0 for j in one)
        and all(there[i] and there[j] for i, j in enumerate(one) if j >= 0)
        and obeys(one, there, constraints)
    )
    following = {i: j for chain in found for i, j in itertools.pairwise(chain)}
    used = {piece for chain in found for piece in chain}
    assert obeys(
        tuple(following.get(i, -1) for i in range(count)),
        tuple(i in used for i in range(count)),
        constraints,
    )
    assert value_of(found, numbers, gain) == pytest.approx(best, abs=1e-6)


def test_what_lies_between_two_who_are_one_leads_from_the_one_to_the_other() -> None:
    """The first would go on as the second and end, and the third come and go on as the last."""
    gains = {(0, 1): 10.0, (2, 3): 10.0, (0, 2): -8.0, (1, 3): -7.0, (1, 2): -30.0, (0, 3): -20.0}
    alone, (earlier, later) = np.full(4, -1.0), np.array(list(gains)).T
    plain = TrackletGraph(
        np.full(4, -9.0), -alone, -alone, earlier, later, -np.array(list(gains.values()))
    )
    assert link_tracklets(plain) == [[0, 1], [2, 3]]
    assert link_tracklets(plain, Constraints(must_link=((0, 3),))) == [[0, 1, 3], [2]]
    assert link_tracklets(plain, Constraints(cannot_link=((0, 1),))) == [[0], [1], [2, 3]]


def test_the_earlier_of_two_that_cannot_both_be_counts() -> None:
    firsts, lasts = np.array([0, 5, 20]), np.array([10, 15, 30])
    constraints = combine_constraints(
        firsts, lasts, [Constraints(((0, 2),)), Constraints(((1, 2),))]
    )
    assert constraints == Constraints(((0, 2),), targets=frozenset({0, 2}))
    assert (
        combine_constraints(
            firsts,
            lasts,
            [
                Constraints(
                    (
                        (0, 2),
                        (1, 2),
                    )
                )
            ],
            strict=True,
        )
        is None
    )
    parted = combine_constraints(
        firsts, lasts, [Constraints(cannot_link=((0, 2),)), Constraints(((0, 2),))]
    )
    assert parted == Constraints(cannot_link=((0, 2),))
