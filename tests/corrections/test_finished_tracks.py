"""Corrections in finished tracks: what they say holds, and nothing else changes."""

from __future__ import annotations

import random

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy import ndarray

from tracker.corrections import Correction
from tracker.corrections.finished_tracks import relabel
from tracker.corrections.kinds import make
from tracker.corrections.outcomes import outcomes

STEPS, LEEWAY = 60, 5


def walkers(people: int) -> tuple[ndarray, ndarray, ndarray]:
    """Steps, ids and places of people who walk side by side, 3 m apart."""
    steps = np.repeat(np.arange(STEPS), people)
    ids = np.tile(np.arange(1, people + 1), STEPS)
    places = np.stack([0.02 * steps, 3.0 * ids, np.full(len(steps), 0.9)], axis=1)
    return steps, ids, places


def at(person: int, step: int) -> list[float]:
    """Where a walker is."""
    return [step, 0.02 * step, 3.0 * person, 0.9]


def exchanged(one: int, other: int, step: int) -> Correction:
    """From a step on the ids of two are each other's."""
    return make(
        kind="exchanged",
        places=[at(one, step - 1), at(other, step - 1), at(other, step), at(one, step)],
    )


@st.composite
def said(draw: st.DrawFn) -> Correction:
    """Anything about two of four walkers."""
    one, other = draw(st.permutations([1, 2, 3, 4]))[:2]
    first = draw(st.integers(1, STEPS - 2))
    kind = draw(st.sampled_from(["exchanged", "different", "nobody", "came", "left", "same"]))
    if kind == "exchanged":
        return exchanged(one, other, first)
    if kind == "nobody":
        return make(kind=kind, places=[at(one, first), at(one, min(first + 9, STEPS - 1))])
    if kind in ("came", "left"):
        return make(kind=kind, places=[at(one, first)])
    return make(
        kind=kind, places=[at(one, first - 1), at(one if kind == "different" else other, first)]
    )


@given(st.lists(said(), max_size=5))
def test_only_who_is_who_changes(told: list[Correction]) -> None:
    steps, ids, places = walkers(4)
    new, kept = relabel(steps, ids, places, told, leeway=LEEWAY)
    pairs = list(zip(steps[kept].tolist(), new[kept].tolist(), strict=True))
    assert len(set(pairs)) == len(pairs), "a track is at one place at a step"
    assert (np.diff(kept) > 0).all()
    again, still = relabel(steps, ids, places, told, leeway=LEEWAY)
    assert (again == new).all()
    assert (still == kept).all()


def partition(steps: ndarray, ids: ndarray, kept: ndarray) -> set[tuple[int, ...]]:
    """The rows of each track, whatever its number."""
    return {tuple(kept[ids[kept] == name].tolist()) for name in set(ids[kept].tolist())}


@given(said())
def test_what_was_made_to_hold_is_not_made_to_hold_again(one: Correction) -> None:
    steps, ids, places = walkers(4)
    new, kept = relabel(steps, ids, places, [one], leeway=LEEWAY)
    own = steps[kept], new[kept], places[kept]
    again, still = relabel(*own, [one], leeway=LEEWAY)
    assert len(still) == len(kept)
    every = np.arange(len(kept))
    assert partition(own[0], again, every) == partition(own[0], own[1], every)


@given(st.lists(said(), max_size=3), st.lists(said(), max_size=3), st.randoms())
def test_the_order_of_those_that_speak_of_different_people_does_not_matter(
    first: list[Correction], second: list[Correction], order: random.Random
) -> None:
    """The second four walk thirty metres away; each four's own order stays."""

    def away(one: Correction) -> Correction:
        return make(kind=one.kind, places=[[k, x + 30.0, y, z] for k, x, y, z in one.places])

    steps, ids, places = walkers(4)
    steps, ids = np.tile(steps, 2), np.concatenate([ids, ids + 4])
    places = np.concatenate([places, places + np.array([30.0, 0.0, 0.0])])
    other = [away(one) for one in second]
    mixed, left, right = list[Correction](), list(first), list(other)
    while left or right:
        mixed.append((left if not right or (left and order.random() < 0.5) else right).pop(0))
    found = []
    for told in ([*first, *other], [*other, *first], mixed):
        new, kept = relabel(steps, ids, places, told, leeway=LEEWAY)
        became = outcomes(steps[kept], new[kept], places[kept], told, leeway=LEEWAY)
        met = {one.id: one.met for one in became}
        found.append((partition(steps, new, kept), kept.tolist(), met))
    assert found[0] == found[1] == found[2]


def test_each_kind_is_met_alone() -> None:
    steps, ids, places = walkers(3)
    gone = (ids == 1) & (steps > 20) | (ids == 2) & (steps < 30)
    rows = ~gone
    steps, ids, places = steps[rows], ids[rows], places[rows]
    for one in (
        exchanged(1, 3, 10),
        make(kind="same", places=[at(1, 20), at(2, 30)]),
        make(kind="different", places=[at(3, 29), at(3, 30)]),
        make(kind="nobody", places=[at(1, 0), at(1, 20)]),
        make(kind="came", places=[at(3, 25)]),
        make(kind="left", places=[at(3, 25)]),
        make(kind="came", places=[at(3, 3)]),
        make(kind="left", places=[at(3, STEPS - 3)]),
        make(kind="name", places=[at(3, 25)], name="Anna"),
        make(kind="checked", first=0, last=9),
    ):
        new, kept = relabel(steps, ids, places, [one], leeway=LEEWAY)
        found = outcomes(steps[kept], new[kept], places[kept], [one], leeway=LEEWAY)
        assert found[0].met, (one.words, found)
        before = outcomes(steps, ids, places, [one], leeway=LEEWAY)
        assert before[0].met == (one.kind in ("name", "checked")), one.words
        expected = len(steps) - (21 if one.kind == "nobody" else 0)
        assert len(kept) == expected, one.words


def test_an_exchange_and_its_way_back_touch_what_is_between() -> None:
    steps, ids, places = walkers(2)
    told = [exchanged(1, 2, 20), exchanged(1, 2, 40)]
    new, _ = relabel(steps, ids, places, told, leeway=LEEWAY)
    between = (steps >= 20) & (steps < 40)
    assert (new[~between] == ids[~between]).all()
    assert (new[between] == 3 - ids[between]).all()


def test_who_is_not_found_is_told_and_changes_nothing() -> None:
    steps, ids, places = walkers(2)
    told = [make(kind="same", places=[[3, 90.0, 0.0, 0.9], at(1, 9)])]
    new, kept = relabel(steps, ids, places, told, leeway=LEEWAY)
    assert (new == ids).all()
    assert len(kept) == len(ids)
    found = outcomes(steps, ids, places, told, leeway=LEEWAY)[0]
    assert not found.met
    assert "found nobody near (90.00, 0.00) at step 3" in found.why


def test_nobody_at_all() -> None:
    nothing = np.zeros(0, dtype=np.int64)
    told = [exchanged(1, 2, 20), make(kind="nobody", places=[at(1, 0)])]
    new, kept = relabel(nothing, nothing, np.zeros((0, 3)), told, leeway=LEEWAY)
    assert len(new) == len(kept) == 0
    found = outcomes(nothing, nothing, np.zeros((0, 3)), told, leeway=LEEWAY)
    assert [one.met for one in found] == [False, True]


def test_an_exchange_of_whom_one_is_not_there_changes_nothing() -> None:
    steps, ids, places = walkers(3)
    told = make(kind="exchanged", places=[at(1, 9), at(7, 9), at(2, 10), at(1, 10)])
    found, kept = relabel(steps, ids, places, [told], leeway=LEEWAY)
    assert found.tolist() == ids.tolist()
    assert kept.tolist() == list(range(len(ids)))


def test_an_exchange_whose_later_places_are_on_one_track_changes_nothing() -> None:
    steps, ids, places = walkers(2)
    beside = [20, 0.4, 3.4, 0.9]
    told = make(kind="exchanged", places=[at(1, 10), at(2, 10), beside, at(1, 20)])
    result, kept = relabel(steps, ids, places, [told], leeway=LEEWAY)
    assert result.tolist() == ids.tolist()
    assert len(kept) == len(ids)
