"""The joining of pieces under what a person said: exact against all ways that obey."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from numpy import ndarray

from tests.smoothing.test_joining import worth_of
from tracker.smoothing.identity.constraints import Said, Ties, possible
from tracker.smoothing.identity.joining import chains, join


def obeys(following: tuple[int, ...], used: tuple[bool, ...], ties: Ties) -> bool:
    """Whether chains are as ties want them."""
    of = {
        piece: number
        for number, chain in enumerate(chains(np.array(following), np.array(used)))
        for piece in chain
    }
    followed = {j for j in following if j >= 0}
    direct = {(i, j) for i, j in enumerate(following) if j >= 0}
    tied = set(ties.together)
    return (
        all(i in of and of[i] == of.get(j) for i, j in ties.together)
        and all(of.get(i, -1) != of.get(j, -2) for i, j in ties.apart)
        and all(piece in of for piece in ties.somebody)
        and not any(piece in of for piece in ties.nobody)
        and all(
            p not in followed or any((i, p) in tied for i, j in direct if j == p)
            for p in ties.firsts
        )
        and all(following[p] < 0 or (p, following[p]) in tied for p in ties.lasts)
    )


def drawn_ties(rng: np.random.Generator, count: int) -> Ties:
    """Some that can be obeyed: pieces begin one after another."""
    firsts = np.arange(count) * 10
    lasts = firsts + rng.integers(1, 9, count)

    def pairs() -> list[tuple[int, int]]:
        pair = sorted(rng.choice(count, 2, replace=False).tolist())
        return [(pair[0], pair[1])] if rng.random() < 0.6 else []

    told = [
        Said(
            pairs(),
            pairs(),
            {int(rng.integers(count))} if rng.random() < 0.2 else set(),
            first=int(rng.integers(count)) if rng.random() < 0.1 else -1,
            last=int(rng.integers(count)) if rng.random() < 0.1 else -1,
        )
        for _ in range(3)
    ]
    found = possible(firsts, lasts, told)
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
    ties = drawn_ties(rng, count)
    earlier, later = np.nonzero(np.isfinite(gain))
    following, used = join(
        numbers["worths"], numbers["births"], numbers["deaths"], earlier, later,
        gain[earlier, later], ties,
    )  # fmt: skip
    for i, j in ties.together:  # what no pair connects may be, with no odds of its own
        if not np.isfinite(gain[i, j]):
            gain[i, j] = numbers["deaths"][i] + numbers["births"][j]
    best = max(
        worth_of(one, there, numbers, gain)
        for one in itertools.product(*([-1, *range(i + 1, count)] for i in range(count)))
        for there in itertools.product((False, True), repeat=count)
        if len({j for j in one if j >= 0}) == sum(j >= 0 for j in one)
        and all(there[i] and there[j] for i, j in enumerate(one) if j >= 0)
        and obeys(one, there, ties)
    )
    assert obeys(tuple(following.tolist()), tuple(used.tolist()), ties)
    found = worth_of(tuple(following.tolist()), tuple(used.tolist()), numbers, gain)
    assert found == pytest.approx(best, abs=1e-6)


def test_what_lies_between_two_who_are_one_leads_from_the_one_to_the_other() -> None:
    """The first would go on as the second and end, and the third come and go on as the last."""
    gains = {(0, 1): 10.0, (2, 3): 10.0, (0, 2): -8.0, (1, 3): -7.0, (1, 2): -30.0, (0, 3): -20.0}
    alone, (earlier, later) = np.full(4, -1.0), np.array(list(gains)).T
    plain = np.full(4, 9.0), alone, alone, earlier, later, np.array(list(gains.values()))
    assert chains(*join(*plain)) == [[0, 1], [2, 3]]
    assert chains(*join(*plain, Ties(together=((0, 3),)))) == [[0, 1, 3], [2]]
    assert chains(*join(*plain, Ties(apart=((0, 1),)))) == [[0], [1], [2, 3]]


def test_the_earlier_of_two_that_cannot_both_be_counts() -> None:
    firsts, lasts = np.array([0, 5, 20]), np.array([10, 15, 30])
    ties = possible(firsts, lasts, [Said([(0, 2)]), Said([(1, 2)])])
    assert ties == Ties(((0, 2),), somebody=frozenset({0, 2}))
    assert possible(firsts, lasts, [Said([(0, 2), (1, 2)])], strict=True) is None
    parted = possible(firsts, lasts, [Said(apart=[(0, 2)]), Said([(0, 2)])])
    assert parted == Ties(apart=((0, 2),))
