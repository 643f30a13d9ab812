"""What corrections say of paths and of their pieces: where they cut, and whom they tie."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy import ndarray

from tests.smoothing.test_boundaries import fitted, standing
from tracker.corrections import Correction
from tracker.corrections.constraints import Constraints
from tracker.corrections.kinds import make
from tracker.smoothing.paths import Paths
from tracker.smoothing.tracklets.constraints import (
    ConstraintResolver,
    combine_constraints,
    constraints_on_chains,
)

PATHS = standing((1, 0, 9, 0.0), (2, 0, 9, 5.0), (3, 14, 19, 0.0))
"""Rows 0 to 9, 10 to 19 and 20 to 25."""


def at(step: int, x: float = 0.0) -> list[float]:
    """A place as a log has it."""
    return [step, x, 0.0, 0.85]


def said(kind: str, *places: list[float], **more: object) -> Correction:
    return make(kind=kind, places=list(places), **more)


def resolver(*corrections: Correction, paths: Paths = PATHS, leeway: int = 2) -> ConstraintResolver:
    return ConstraintResolver(fitted(paths), corrections, leeway)


def pieces() -> tuple[Paths, ndarray]:
    """The first path in three pieces, 0 to 2, 4 to 5 and 7 to 9; the others whole."""
    cut = standing((1, 0, 2, 0.0), (1, 4, 5, 0.0), (1, 7, 9, 0.0), (2, 0, 9, 5.0), (3, 14, 19, 0.0))
    return cut, np.array([0, 1, 2, 4, 5, 7, 8, 9, *range(10, 26)])


@pytest.mark.parametrize(
    ("one", "rows"),
    [
        (said("came", at(4)), [4]),
        (said("came", at(0)), [0]),
        (said("left", at(4)), [5]),
        (said("left", at(9)), []),  # with its path it ends anyway
        (said("left", at(19)), []),  # and with the last row
        (said("nobody", at(3), at(6)), [3, 7]),
        (said("nobody", at(14), at(19)), [20]),
        (said("came", at(4, 3.0)), []),  # there is nobody
        (said("same", at(2), at(5)), []),  # one path is one person's already
        (said("same", at(9), at(14)), []),  # the one is gone when the other comes
        (said("different", at(2), at(5, 5.0)), []),
        (said("name", at(4), name="Anna"), []),
        (said("here", at(4)), []),
    ],
)
def test_where_a_correction_cuts(one: Correction, rows: list[int]) -> None:
    assert np.flatnonzero(resolver(one).breaks()).tolist() == rows


def test_who_is_not_the_same_later_is_cut_before_the_largest_jump_in_between() -> None:
    paths = standing((1, 0, 9, 0.0))
    states = paths.states.copy()
    states[4:, 0], states[8:, 0] = 0.2, 0.9
    jumping = replace(fitted(paths), paths=paths.with_states(states, paths.covariances))
    # what the rows before say of each row is where the row before was
    ahead = np.concatenate([states[:1], states[:-1]])
    jumping = replace(jumping, ahead=ahead, ahead_covariances=2.0 * paths.covariances)
    for first, last, cut in ((1, 6, 4), (1, 9, 8), (3, 4, 4), (7, 8, 8)):
        one = said("different", at(first, states[first, 0]), at(last, states[last, 0]))
        assert np.flatnonzero(ConstraintResolver(jumping, [one], 2).breaks()).tolist() == [cut]


@pytest.mark.parametrize(
    ("told", "constraints"),
    [
        ([said("same", at(2), at(5, 5.0))], Constraints()),  # both are there at once
        ([said("same", at(8), at(15))], Constraints(((2, 4),), targets=frozenset({2, 4}))),
        # before the first place what ends is meant, after the second what begins
        ([said("same", at(3), at(14))], Constraints(((0, 4),), targets=frozenset({0, 4}))),
        ([said("same", at(3), at(6))], Constraints(((0, 2),), targets=frozenset({0, 2}))),
        ([said("same", at(2), at(4))], Constraints(((0, 1),), targets=frozenset({0, 1}))),
        ([said("same", at(4), at(5))], Constraints()),
        ([said("different", at(3), at(6))], Constraints(cannot_link=((0, 2),))),
        ([said("different", at(2), at(6))], Constraints(cannot_link=((0, 2),))),
        ([said("same", at(8), at(15, 2.0))], Constraints()),  # nobody is at the second place
        ([said("came", at(6))], Constraints(targets=frozenset({2}), firsts=frozenset({2}))),
        ([said("left", at(6))], Constraints(targets=frozenset({1}), lasts=frozenset({1}))),
        ([said("here", at(6))], Constraints(targets=frozenset({1}))),
        ([said("here", at(6, 2.0), at(6))], Constraints(targets=frozenset({1}))),
        ([said("nobody", at(4), at(5))], Constraints(clutter=frozenset({1}))),
        ([said("nobody", at(0), at(9))], Constraints(clutter=frozenset({0, 1, 2}))),
        ([said("name", at(4), name="Anna")], Constraints()),
        ([make(kind="checked", first=0, last=9)], Constraints()),
        # whom one correction joins the next does not take away
        ([said("same", at(8), at(15)), said("nobody", at(7), at(9))],
         Constraints(((2, 4),), targets=frozenset({2, 4}))),
        ([said("nobody", at(7), at(9)), said("same", at(8), at(15))],
         Constraints(clutter=frozenset({2}))),
    ],
)  # fmt: skip
def test_what_a_correction_says_of_pieces(told: list[Correction], constraints: Constraints) -> None:
    assert resolver(*told).constraints(*pieces()) == constraints


def test_two_who_exchange_are_tied_across_and_parted() -> None:
    cut = standing((1, 0, 4, 0.0), (1, 5, 9, 0.0), (2, 0, 4, 5.0), (2, 5, 9, 5.0))
    paths = standing((1, 0, 9, 0.0), (2, 0, 9, 5.0))
    one = said("exchanged", at(3), at(3, 5.0), at(6, 5.0), at(6))
    found = resolver(one, paths=paths).constraints(cut, np.arange(20))
    assert found.must_link == ((0, 3), (2, 1))
    assert found.cannot_link == ((0, 1), (2, 3))
    assert found.targets == {0, 1, 2, 3}
    # cut at the same step of both, between the places
    rows = np.flatnonzero(resolver(one, paths=paths).breaks())
    assert len(rows) == 2
    assert rows[1] == rows[0] + 10
    assert 4 <= rows[0] <= 6


@pytest.mark.parametrize(("before", "after"), [(1, 3), (3, 6), (3, 4), (2, 3)])
def test_of_who_exchange_in_a_gap_what_ends_before_and_what_begins_after_it_is_meant(
    before: int, after: int
) -> None:
    """Both are in pieces that end at step 2 and begin at step 4."""
    cut = standing((1, 0, 2, 0.0), (1, 4, 9, 0.0), (2, 0, 2, 5.0), (2, 4, 9, 5.0))
    kept = np.delete(np.arange(20), [3, 13])
    one = said("exchanged", at(before), at(before, 5.0), at(after, 5.0), at(after))
    found = resolver(one, paths=standing((1, 0, 9, 0.0), (2, 0, 9, 5.0))).constraints(cut, kept)
    assert (found.must_link, found.cannot_link) == (((0, 3), (2, 1)), ((0, 1), (2, 3)))


def test_all_pieces_that_are_spoken_of_are_meant() -> None:
    cut, kept = pieces()
    told = [said("same", at(8), at(15)), said("here", at(4)), said("nobody", at(0), at(2))]
    assert resolver(*told).referenced_tracklets(cut, kept) == {0, 1, 2, 4}
    assert resolver(said("same", at(8), at(15, 2.0))).referenced_tracklets(cut, kept) == {2}
    nothing = np.zeros(0, dtype=np.int64)
    empty = Paths.of([], [], [], [], 6)
    assert resolver(*told).referenced_tracklets(empty, nothing) == set()


def test_limits_and_ties_of_chains_are_those_of_their_pieces() -> None:
    cut, _ = pieces()
    constraints = Constraints(
        must_link=((2, 4),), cannot_link=((0, 3),), firsts=frozenset({0}), lasts=frozenset({4})
    )
    found = constraints_on_chains(constraints, [[0, 1], [2], [3], [4]], cut)
    assert found is not None
    assert (found.must_link, found.cannot_link) == (((1, 3),), ((0, 2),))
    assert (found.firsts, found.lasts) == ({0}, {3})
    assert found.targets == {0, 1, 3}
    # who is in no chain says nothing; two of one person's that overlap cannot both be
    assert (
        constraints_on_chains(Constraints(cannot_link=((0, 3),), firsts=frozenset({3})), [[0]], cut)
        == Constraints()
    )
    assert constraints_on_chains(Constraints(must_link=((0, 3),)), [[0], [3]], cut) is None


@pytest.mark.parametrize(
    "kind", ["must_link", "cannot_link", "targets", "clutter", "firsts", "lasts"]
)
def test_one_constraint_of_any_kind_is_something_to_obey(kind: str) -> None:
    assert not Constraints()
    pairs = kind in ("must_link", "cannot_link")
    assert replace(Constraints(), **{kind: ((0, 1),) if pairs else frozenset({0})})


def test_one_person_is_in_one_place_whatever_the_order_of_pairs() -> None:
    firsts, lasts = np.array([0, 5, 10, 7]), np.array([4, 9, 14, 12])
    found = combine_constraints(firsts, lasts, [Constraints(((1, 2),)), Constraints(((0, 2),))])
    assert found is not None
    assert found.must_link == ((0, 1), (1, 2))
    # the fourth overlaps two of them
    assert combine_constraints(
        firsts, lasts, [Constraints(((0, 1),)), Constraints(((0, 3),))]
    ) == Constraints(((0, 1),), targets=frozenset({0, 1}))
    # two of one person who are told apart later, and two who are told apart joined by a third
    later = combine_constraints(
        firsts,
        lasts,
        [Constraints(((0, 1),)), Constraints(((1, 2),)), Constraints(cannot_link=((0, 2),))],
    )
    assert later is not None
    assert (later.cannot_link, later.must_link) == ((), ((0, 1), (1, 2)))
    first = combine_constraints(
        firsts,
        lasts,
        [Constraints(cannot_link=((0, 2),)), Constraints(((0, 1),)), Constraints(((1, 2),))],
    )
    assert first is not None
    assert (first.cannot_link, first.must_link) == (((0, 2),), ((0, 1),))
