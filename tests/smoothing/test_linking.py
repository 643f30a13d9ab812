"""The joining of pieces: exact against all ways, and what corrections say of paths and pieces."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from numpy import ndarray
from numpy.testing import assert_allclose

from tests.smoothing.test_boundaries import fitted, standing
from tracker.corrections import Correction
from tracker.corrections.constraints import Constraints
from tracker.corrections.kinds import make
from tracker.kernels.smoothing.passes import ExistenceTransitions, presence
from tracker.smoothing.paths import Links, Paths, contested_shares, join_chains, split_paths
from tracker.smoothing.tracklets.constraints import (
    ConstraintResolver,
    combine_constraints,
    constraints_on_chains,
)
from tracker.smoothing.tracklets.linking import PriorLinks
from tracker.smoothing.tracklets.motion import Pairs
from tracker.smoothing.tracklets.solver import TrackletGraph, link_tracklets


def chains(following: tuple[int, ...], used: tuple[bool, ...]) -> list[list[int]]:
    """The pieces of each chain, by who follows each."""
    result = []
    for piece in np.flatnonzero(used).tolist():
        if piece in following:
            continue
        chain = [piece]
        while following[chain[-1]] >= 0:
            chain.append(following[chain[-1]])
        result.append(chain)
    return result


def graph_of(numbers: dict[str, ndarray], gain: ndarray) -> TrackletGraph:
    """The graph of pieces whose log odds are given, with a link where a gain is finite."""
    earlier, later = np.nonzero(np.isfinite(gain))
    return TrackletGraph(
        -numbers["worths"], -numbers["births"], -numbers["deaths"],
        earlier, later, -gain[earlier, later], numbers.get("people"),
    )  # fmt: skip


def value_of(found: list[list[int]], numbers: dict[str, ndarray], gain: ndarray) -> float:
    """The objective of chains."""
    following = {i: j for chain in found for i, j in itertools.pairwise(chain)}
    used = {piece for chain in found for piece in chain}
    count = len(gain)
    return worth_of(
        tuple(following.get(i, -1) for i in range(count)),
        tuple(i in used for i in range(count)),
        numbers,
        gain,
    )


def worth_of(
    following: tuple[int, ...], used: tuple[bool, ...], numbers: dict[str, ndarray], gain: ndarray
) -> float:
    """The objective, -inf for what is no set of chains."""
    total = 0.0
    followed = [j for j in following if j >= 0]
    if len(set(followed)) < len(followed):
        return -np.inf
    for i, (j, there) in enumerate(zip(following, used, strict=True)):
        if not there:
            if j >= 0 or i in followed:
                return -np.inf
            continue
        total += numbers["worths"][i]
        total += gain[i, j] if j >= 0 else numbers["deaths"][i]
        if i not in followed:
            total += numbers["births"][i]
        if j >= 0 and not used[j]:
            return -np.inf
    return total


@pytest.mark.parametrize("seed", range(40))
def test_the_best_of_all_ways_to_join_a_few_pieces(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 5))
    numbers = {
        "worths": rng.normal(2.0, 6.0, count),
        "births": rng.normal(-4.0, 1.0, count),
        "deaths": rng.normal(-4.0, 1.0, count),
    }
    gain = np.where(
        np.triu(rng.random((count, count)) < 0.7, 1), rng.normal(-3.0, 5.0, (count, count)), -np.inf
    )
    found = link_tracklets(graph_of(numbers, gain))
    best = max(
        worth_of(one, there, numbers, gain)
        for one in itertools.product(range(-1, count), repeat=count)
        for there in itertools.product((False, True), repeat=count)
    )
    assert value_of(found, numbers, gain) == pytest.approx(best, abs=1e-9)
    assert found == sorted(found)


@pytest.mark.parametrize("seed", range(30))
def test_the_best_of_all_ways_whose_chains_are_one_person_each(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 5))
    people = rng.normal(0.0, 4.0, (count, 2 + seed % 2))
    numbers = {
        "worths": rng.normal(2.0, 6.0, count),
        "births": rng.normal(-4.0, 1.0, count),
        "deaths": rng.normal(-4.0, 1.0, count),
        "people": people - people.max(axis=1, keepdims=True),
    }
    gain = np.where(
        np.triu(rng.random((count, count)) < 0.8, 1), rng.normal(2.0, 4.0, (count, count)), -np.inf
    )

    def loss(found: list[list[int]]) -> float:
        return -sum(float(numbers["people"][chain].sum(axis=0).max()) for chain in found)

    found = link_tracklets(graph_of(numbers, gain))
    best = max(
        worth - loss(chains(one, there))
        for one in itertools.product(range(-1, count), repeat=count)
        for there in itertools.product((False, True), repeat=count)
        if np.isfinite(worth := worth_of(one, there, numbers, gain))
    )
    # a loss of less than 1 is accepted
    assert best - 1.0 < value_of(found, numbers, gain) - loss(found) <= best + 1e-9
    if loss(found) >= 1.0:
        assert value_of(found, numbers, gain) - loss(found) == pytest.approx(best, abs=1e-6)


def test_nothing_to_join() -> None:
    nothing = np.zeros(0)
    none = np.zeros(0, dtype=np.int64)
    assert link_tracklets(TrackletGraph(nothing, nothing, nothing, none, none, nothing)) == []


@pytest.mark.parametrize("seed", range(20))
def test_when_somebody_was_there_is_the_best_of_all_sequences(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count, stay, enter, change = 8, -0.05, -1.0, -2.0
    votes = rng.normal(0.0, 2.0, count)
    begin = seed % 3
    end = begin + count - 1 if seed % 2 else begin + count + 5

    def score(there: tuple[bool, ...]) -> float:
        if not any(there):
            return 0.0
        here = np.flatnonzero(there)
        first, last = here[0], here[-1]
        total = votes[here].sum() + (enter if begin + last < end else 0.0)
        total += enter if begin + first > 0 else 0.0
        for k in range(first + 1, last + 1):
            total += change if there[k] != there[k - 1] else stay if there[k] else 0.0
        return float(total)

    ways = {there: score(there) for there in itertools.product((False, True), repeat=count)}
    best = max(ways, key=lambda there: ways[there])
    chances, odds = presence(
        np.array([0, count]),
        np.array([begin]),
        votes,
        ExistenceTransitions(stay, enter, change),
        end,
    )
    assert (chances > 0.5).tolist() == list(best)
    assert odds[0] == pytest.approx(max(v for there, v in ways.items() if any(there)))
    for k in range(count):
        here = max(v for there, v in ways.items() if there[k])
        away = max(v for there, v in ways.items() if not there[k])
        assert chances[k] == pytest.approx(1.0 / (1.0 + np.exp(away - here)))


def straight(label: int, first: int, begin: float, count: int, side: float = 0.0) -> Paths:
    """Somebody who walks along x at 1 m/s, seen well at every step of 0.1 s."""
    states = np.zeros((count, 6))
    states[:, 0] = begin + 0.1 * np.arange(count)
    states[:, 1], states[:, 2], states[:, 3] = side, 1.0, 1.0
    covariances = np.tile(np.diag([1e-3, 1e-3, 1e-3, 0.01, 0.01, 0.01]), (count, 1, 1))
    return Paths.of([label], [first], [states], [covariances], 6)


def together(*paths: Paths) -> Paths:
    return Paths.of(
        [int(one.labels[0]) for one in paths],
        [int(one.firsts[0]) for one in paths],
        [one.states for one in paths],
        [one.covariances for one in paths],
        6,
    )


def test_boxes_that_are_as_well_anothers_are_contested() -> None:
    paths = together(straight(1, 0, 0.0, 2), straight(2, 0, 0.0, 2, side=0.2))
    links = Links(
        np.zeros(4, dtype=np.int64),
        np.array([0, 2, 1, 3]),
        np.array([0, 0, 1, 2]),
        np.array([0.5, 0.5, 1.0, 1.0]),
    )
    assert_allclose(contested_shares(paths, links), [1.0, 0.0, 1.0, 0.0])
    uneven = Links(links.cameras, links.rows, links.boxes, np.array([0.8, 0.2, 1.0, 1.0]))
    assert_allclose(contested_shares(paths, uneven), [0.25, 0.0, 1.0, 0.0])


def test_a_cut_leaves_the_clear_rows_where_they_were() -> None:
    paths = together(straight(1, 3, 0.0, 6), straight(2, 0, 0.0, 3))
    clear = np.array([True, True, False, True, True, True, True, True, True])
    breaks = np.zeros(9, dtype=bool)
    breaks[5] = True
    pieces, kept = split_paths(paths, clear, breaks)
    assert pieces.labels.tolist() == [1, 1, 1, 2]
    assert pieces.firsts.tolist() == [3, 6, 8, 0]
    assert np.diff(pieces.starts).tolist() == [2, 2, 1, 3]
    assert_allclose(pieces.states, paths.states[kept])
    assert pieces.steps.tolist() == paths.steps[kept].tolist()


def test_pieces_in_a_row_are_one_path_straight_through_their_gaps() -> None:
    pieces = together(straight(1, 3, 0.0, 3), straight(2, 0, 5.0, 2), straight(7, 8, 1.4, 4))
    whole, place = join_chains(pieces, [[1], [0, 2]], [9, 4])
    assert (whole.labels.tolist(), whole.firsts.tolist()) == ([9, 4], [0, 3])
    assert whole.lasts.tolist() == [1, 11]
    assert place.tolist() == [2, 3, 4, 0, 1, 7, 8, 9, 10]
    assert_allclose(whole.states[place], pieces.states)
    assert_allclose(whole.covariances[place], pieces.covariances)
    assert_allclose(whole.states[5:7, 0], [0.2 + 0.4, 0.2 + 0.8])
    assert_allclose(whole.covariances[5:7], np.tile(np.eye(6), (2, 1, 1)))
    some, left_out = join_chains(pieces, [[2]], [5])
    assert left_out.tolist() == [-1] * 5 + [0, 1, 2, 3]
    assert some.firsts.tolist() == [8]


@pytest.mark.parametrize("seed", range(6))
def test_a_box_is_lost_to_the_other_with_the_largest_share(seed: int) -> None:
    """Of each row the share of its boxes that another row has too, by going through all links."""
    rng = np.random.default_rng(seed)
    paths = together(straight(1, 0, 0.0, 3), straight(2, 0, 0.0, 3))
    links = Links(*rng.integers(0, [[2], [6], [3]], (3, 14)), rng.uniform(0.05, 1.0, 14))
    own, lost = np.zeros(6), np.zeros(6)
    for k in range(14):
        same = (links.cameras == links.cameras[k]) & (links.boxes == links.boxes[k])
        same[k] = False
        rival = links.shares[same].max(initial=0.0)
        own[links.rows[k]] += links.shares[k]
        lost[links.rows[k]] += min(links.shares[k], rival)
    assert_allclose(contested_shares(paths, links), lost / np.maximum(own, 1e-12))


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
    # the last first: nothing depends on how they are numbered
    turned = replace(plain, earlier=3 - earlier, later=3 - later)
    assert link_tracklets(turned, Constraints(must_link=((1, 0),))) == [[1, 0], [3, 2]]
    assert link_tracklets(turned, Constraints(must_link=((3, 0),))) == [[1], [3, 2, 0]]


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


PIECES = 6
"""Three people, each in two pieces of two rows: 0 and 3, 1 and 4, 2 and 5."""
WHO = np.repeat([0, 1, 2, 0, 1, 2], 2)

CUT = Paths.of(
    list(range(PIECES)),
    [0, 0, 0, 3, 3, 3],
    [np.zeros((2, 3))] * PIECES,
    [np.tile(np.eye(3), (2, 1, 1))] * PIECES,
    3,
)
EARLIER, LATER = np.array([0, 1, 2, 0, 1]), np.array([3, 4, 5, 4, 5])
PAIRS = Pairs(EARLIER, LATER, np.full(5, 2), np.array([5.0, 5.0, 5.0, 5.5, 5.5]))
"""All three best go on as themselves; two alone, the first as the second and he as the third."""


def joined(gains: np.ndarray, constraints: Constraints) -> list[list[int]]:
    alone = np.full(PIECES, 1.0)
    graph = TrackletGraph(np.full(PIECES, -9.0), alone, alone, EARLIER, LATER, -gains)
    return link_tracklets(graph, constraints)


def test_who_is_parted_takes_nobody_elses_place() -> None:
    rows = np.arange(2 * PIECES)
    plain, prior_links = PriorLinks(), PriorLinks(WHO)
    assert joined(plain.gains(PAIRS, CUT, rows), Constraints()) == [[0, 3], [1, 4], [2, 5]]
    said = Constraints(cannot_link=((0, 3),), targets=frozenset({3}))
    moved = joined(plain.gains(PAIRS, CUT, rows), said)
    assert moved != [[0], [1, 4], [2, 5], [3]], "its own odds would move those nobody spoke of"
    assert joined(prior_links.gains(PAIRS, CUT, rows), said) == [[0], [1, 4], [2, 5], [3]]


def test_what_was_in_no_piece_of_anybody_and_what_was_two_peoples_has_its_own_odds() -> None:
    rows = np.arange(2 * PIECES)
    lost = np.where(WHO == 0, -1, WHO)
    more = PriorLinks(lost).gains(PAIRS, CUT, rows) - PAIRS.gains
    assert (more[[0, 3, 4]] == 0.0).all()
    assert (more[[1, 2]] > 0.0).all()
    # of those who were one person every join stays, the first label's too
    assert ((PriorLinks(WHO).gains(PAIRS, CUT, rows) - PAIRS.gains) > 0.0).tolist() == [
        True, True, True, False, False
    ]  # fmt: skip
    nothing = Pairs(EARLIER[:0], LATER[:0], LATER[:0], np.zeros(0))
    assert len(PriorLinks(WHO).gains(nothing, CUT, rows)) == 0


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
        (said("different", at(2), at(5, 3.0)), []),
        (said("same", at(2), at(5, 3.0)), []),
        (said("different", at(12), at(13)), []),  # both nearest to one row
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
