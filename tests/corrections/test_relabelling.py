"""Corrections in finished tracks: what they say holds, and nothing else changes."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy import ndarray

from tracker.corrections import Correction
from tracker.corrections.kinds import make
from tracker.corrections.outcomes import outcomes
from tracker.corrections.relabelling import relabelled
from tracker.corrections.resting import resting

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
    new, kept = relabelled(steps, ids, places, told, leeway=LEEWAY)
    pairs = list(zip(steps[kept].tolist(), new[kept].tolist(), strict=True))
    assert len(set(pairs)) == len(pairs), "a track is at one place at a step"
    assert (np.diff(kept) > 0).all()
    again, still = relabelled(steps, ids, places, told, leeway=LEEWAY)
    assert (again == new).all()
    assert (still == kept).all()


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
        new, kept = relabelled(steps, ids, places, [one], leeway=LEEWAY)
        found = outcomes(steps[kept], new[kept], places[kept], [one], leeway=LEEWAY)
        assert found[0].met, (one.words, found)
        before = outcomes(steps, ids, places, [one], leeway=LEEWAY)
        assert before[0].met == (one.kind in ("name", "checked")), one.words
        expected = len(steps) - (21 if one.kind == "nobody" else 0)
        assert len(kept) == expected, one.words


def test_who_was_joined_keeps_the_longer_ones_number() -> None:
    steps, ids, places = walkers(2)
    rows = (ids == 1) & (steps < 10) | (ids == 2) & (steps >= 12)
    told = [make(kind="same", places=[at(1, 9), at(2, 12)])]
    new, _ = relabelled(steps[rows], ids[rows], places[rows], told, leeway=LEEWAY)
    assert set(new.tolist()) == {2}


def test_an_exchange_and_its_way_back_touch_what_is_between() -> None:
    steps, ids, places = walkers(2)
    told = [exchanged(1, 2, 20), exchanged(1, 2, 40)]
    new, _ = relabelled(steps, ids, places, told, leeway=LEEWAY)
    between = (steps >= 20) & (steps < 40)
    assert (new[~between] == ids[~between]).all()
    assert (new[between] == 3 - ids[between]).all()


def test_who_is_not_found_is_told_and_changes_nothing() -> None:
    steps, ids, places = walkers(2)
    told = [make(kind="same", places=[[3, 90.0, 0.0, 0.9], at(1, 9)])]
    new, kept = relabelled(steps, ids, places, told, leeway=LEEWAY)
    assert (new == ids).all()
    assert len(kept) == len(ids)
    found = outcomes(steps, ids, places, told, leeway=LEEWAY)[0]
    assert not found.met
    assert "found nobody near (90.00, 0.00) at step 3" in found.why


def test_what_stands_against_one_that_is_not_met_is_told() -> None:
    steps, ids, places = walkers(2)
    told = [
        make(kind="same", places=[at(1, 10), at(1, 40)]),
        make(kind="different", places=[at(1, 20), at(1, 30)]),
        make(kind="different", places=[at(2, 20), at(2, 30)]),
    ]
    against, alone = outcomes(steps, ids, places, told, leeway=LEEWAY)[1:]
    assert against.why == 'they are one track, 1; "same person, steps 10 – 40" holds there'
    assert alone.why == "they are one track, 2"


def test_rows_rest_on_a_join_from_where_somebody_comes_back() -> None:
    steps, ids, places = walkers(2)
    there = (ids == 2) | (steps < 20) | (steps >= 30)
    steps, ids, places = steps[there], ids[there], places[there]
    told = [
        make(kind="same", places=[at(1, 10), at(1, 40)]),
        make(kind="same", places=[at(2, 10), at(2, 40)]),
    ]
    met = outcomes(steps, ids, places, told, leeway=LEEWAY)
    rests = np.array(resting(steps, ids, places, told, met))
    assert steps[rests == told[0].id].tolist() == list(range(30, STEPS))
    assert steps[rests == told[1].id].tolist() == list(range(40, STEPS))


def test_nobody_at_all() -> None:
    nothing = np.zeros(0, dtype=np.int64)
    told = [exchanged(1, 2, 20), make(kind="nobody", places=[at(1, 0)])]
    new, kept = relabelled(nothing, nothing, np.zeros((0, 3)), told, leeway=LEEWAY)
    assert len(new) == len(kept) == 0
    found = outcomes(nothing, nothing, np.zeros((0, 3)), told, leeway=LEEWAY)
    assert [one.met for one in found] == [False, True]
