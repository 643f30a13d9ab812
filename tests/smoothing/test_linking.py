"""The joining of pieces: exact against all ways, and what cuts and pairs say."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from numpy import ndarray
from numpy.testing import assert_allclose

from tracker.kernels.smoothing.passes import ExistenceTransitions, presence
from tracker.smoothing.paths import Links, Paths, contested_shares, join_chains, split_paths
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
    people = rng.normal(0.0, 4.0, (count, 3))
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
