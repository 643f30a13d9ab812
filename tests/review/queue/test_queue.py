"""The queue of doubtful places: what is at stake first, and what was settled no more."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from numpy import ndarray

from tests import world
from tests.conftest import short
from tests.engine.synthetic import crossing, sequence, walk
from tests.runs.test_corrected_runs import run_of, with_a_gap
from tracker.corrections import Correction, Place
from tracker.corrections.kinds import Kind, make
from tracker.fusion.trajectories import Trajectories, apply_corrections
from tracker.parameters.catalogue import RunParameters
from tracker.review.queue import queue
from tracker.review.queue.clear_places import ClearPlaces
from tracker.review.queue.item import (
    Alternative,
    ItemKind,
    ReviewItem,
    TrackRows,
    confirm,
    propose,
)
from tracker.review.queue.moves import Move, Tracklet
from tracker.review.queue.other_run import OtherRun
from tracker.review.queue.ranking import (
    IdentityReach,
    _as_it_is,
    _item_of,
    _Site,
    _with_halves,
    _with_none_of_them,
    is_answered,
    once_each,
    words_of,
)
from tracker.runs.run import Run
from tracker.single_view.protocol import ViewResult
from tracker.steps.steps import Steps

PAIRED = ("same", "different", "exchanged")
"""Kinds of corrections of two places or more of one person or of two."""


@pytest.mark.parametrize("smoothing", short(["identities", "positions", "none"]))
def test_who_was_away_is_asked_for_first_and_not_again(smoothing: str) -> None:
    path = walk((-1.1, 0.5, 1.0), (1.1, 0.6, 1.0), 80)
    other = walk((1.1, -0.7, 1.0), (-1.0, -0.6, 1.0), 80)
    whole = sequence([(0, path[:30]), (48, path[48:]), (0, other)], 80)
    run = run_of(whole, (), smoothing=smoothing)
    assert len(set(run.tracks.ids.tolist())) == 3
    found = queue(run)
    first = found.items[0]
    assert first.kind == "join"
    assert 25 <= first.first < first.last <= 55
    assert sum(one.probability for one in first.alternatives) == pytest.approx(1.0, abs=0.05)
    answer = confirm(first.alternatives[1].corrections, "the same")
    after = run_of(whole, answer, smoothing=smoothing)
    assert [one.met for one in after.outcomes] == [True]
    assert len(set(after.tracks.ids.tolist())) == 2
    rest = queue(after)
    assert first.id not in [one.id for one in rest.items]
    kept = run_of(whole, confirm(first.alternatives[0].corrections), smoothing=smoothing)
    assert first.id not in [one.id for one in queue(kept).items]


def test_the_most_at_stake_comes_first() -> None:
    weights = [one.weight for one in queue(run_of(with_a_gap())).items]
    assert weights == sorted(weights, reverse=True)


def test_nobody_is_nothing_to_check() -> None:
    found = queue(run_of(sequence([], 20)))
    assert found.items == ()
    assert "nobody" in found.how


def test_the_other_run_weighs_a_move_by_who_is_who_there() -> None:
    run = run_of(sequence(crossing(60), 60))
    tracks = run.tracks
    lanes = TrackRows(tracks)
    one, other = (int(track) for track in lanes.ids)
    places = [lanes.place(one, 29), lanes.place(other, 29), lanes.place(other, 30),
              lanes.place(one, 30)]  # fmt: skip
    swapped: Trajectories = apply_corrections(tracks, propose("exchanged", places), 1.0 / 25.0)
    tracklets = [
        Tracklet(track, lanes.place(track, 30), lanes.place(track, 29)) for track in (one, other)
    ]
    move = Move((tracklets[0], tracklets[1]), (tracklets[0], tracklets[1]), "exchange", 0.0)
    assert OtherRun(tracks, swapped, 1.0 / 25.0).with_evidence(move).log_odds > 0.0
    assert OtherRun(tracks, tracks, 1.0 / 25.0).with_evidence(move).log_odds < 0.0
    told = [m for m in OtherRun(tracks, swapped, 1.0 / 25.0).moves() if m.kind == "exchange"]
    assert told, "it sees the exchange itself"
    assert abs(told[0].earlier[0].end.step - 29) <= 1
    assert not list(OtherRun(tracks, tracks, 1.0 / 25.0).moves())


def test_a_doubt_is_known_again_by_its_places() -> None:
    run = run_of(with_a_gap())
    again = [one.id for one in queue(run).items]
    assert again == [one.id for one in queue(run_of(with_a_gap())).items]
    assert len(set(again)) == len(again)
    assert np.isfinite([one.weight for one in queue(run).items]).all()
    assert Place(3, 1.0, 2.0, 0.8).words == "(1.00, 2.00) at step 3"


def test_who_is_who_is_asked_between_places_where_people_stand_clear() -> None:
    one = walk((-1.4, -1.4, 1.0), (1.4, 1.4, 1.0), 80)
    other = walk((1.4, -1.4, 1.0), (-1.4, 1.4, 1.0), 80)
    run = run_of(sequence([(0, one), (0, other)], 80))
    lanes = TrackRows(run.tracks)
    track, third = (int(name) for name in lanes.ids)
    clear = ClearPlaces(lanes, 1.0 / 25.0)
    apart = np.linalg.norm((one - other)[:, :2], axis=1)
    near = np.flatnonzero(apart < 2.0)
    before, after = clear.before(track, 40), clear.after(track, 40)
    assert abs(before.step - (near[0] - 1)) <= 2
    assert abs(after.step - (near[-1] + 1)) <= 2
    assert clear.before(third, 3).step == 3


def test_none_of_those_who_are_told_may_be_said() -> None:
    run = run_of(with_a_gap())
    for one in queue(run).items:
        parted = [a for a in one.alternatives if all(c.kind == "different" for c in a.corrections)]
        told = {
            pair
            for a in one.alternatives
            for c in a.corrections
            for pair in c.constraints.must_link
        }
        if one.kind != "short":
            assert parted
            assert {
                pair for c in parted[-1].corrections for pair in c.constraints.cannot_link
            } & told


def test_who_says_that_it_is_as_it_is_changes_nothing() -> None:
    for whole in (with_a_gap(), sequence(crossing(60), 60)):
        plain = run_of(whole)
        told = [
            one.alternatives[0].corrections
            for one in queue(plain).items
            if any(
                c.constraints.must_link or c.constraints.cannot_link
                for c in one.alternatives[0].corrections
            )
        ]
        assert told or len(set(plain.tracks.ids.tolist())) == 2
        for corrections in told:
            run = run_of(whole, confirm(corrections))
            assert all(one.met for one in run.outcomes)
            np.testing.assert_array_equal(run.tracks.ids, plain.tracks.ids)
            np.testing.assert_array_equal(run.tracks.positions, plain.tracks.positions)


def test_none_of_those_who_are_told_parts_from_all_of_them() -> None:
    places = {
        name: Place(step, x / 3.0, 0.7, 0.9)  # not as round as a correction writes them
        for name, (step, x) in {
            "a": (10, 1.0),
            "b": (12, 2.0),
            "c": (20, 1.1),
            "d": (22, 2.2),
        }.items()
    }
    one, other = (Tracklet(k, places[end], places[end]) for k, end in ((1, "a"), (2, "b")))
    after, begins = (Tracklet(k, places[at], places[at]) for k, at in ((1, "c"), (3, "d")))
    move = Move((one,), (after, begins), "exchange", 0.0)
    now = Alternative("as it is", 0.5, propose("same", (one.end, after.begin)))
    goes_on = Alternative("1 goes on as 3", 0.3, propose("same", (one.end, begins.begin)))
    came = Alternative("2 goes on", 0.2, propose("same", (other.end, after.begin)))
    none = _with_none_of_them(move, now, [goes_on, came])[-1]
    assert none.words == "none of these"
    apart = {(a.step, b.step) for told in none.corrections for a, b in told.constraints.cannot_link}
    assert apart == {(10, 20), (10, 22), (12, 20)}


def test_two_who_were_parted_anywhere_are_not_asked_for_again() -> None:
    run = run_of(with_a_gap())
    join = next(one for one in queue(run).items if one.kind == "join")
    lanes = TrackRows(run.tracks)
    first, second = join.tracks
    # far from the places that the queue would ask for
    far = propose("different", (lanes.of_row(int(lanes.rows[first][2])),
                               lanes.of_row(int(lanes.rows[second][-3]))))  # fmt: skip
    after = run_of(with_a_gap(), confirm(far))
    assert [one.met for one in after.outcomes] == [True]
    assert all(one.kind != "join" for one in queue(after).items)


@pytest.mark.parametrize("kind", ["left", "came"])
def test_who_left_or_came_in_is_not_asked_for_as_going_on(kind: Kind) -> None:
    run = run_of(with_a_gap())
    join = next(one for one in queue(run).items if one.kind == "join")
    lanes = TrackRows(run.tracks)
    first, second = join.tracks
    row = lanes.rows[first][-1] if kind == "left" else lanes.rows[second][0]
    after = run_of(with_a_gap(), confirm(propose(kind, (lanes.of_row(int(row)),))))
    assert [one.met for one in after.outcomes] == [True]
    assert all(one.kind != "join" for one in queue(after).items)


def test_who_goes_on_as_another_is_asked_aside_of_the_moment_itself() -> None:
    run = run_of(sequence([(0, walk((-1.1, 0.0, 1.0), (1.1, 0.0, 1.0), 80))], 80))
    lanes = TrackRows(run.tracks)
    track = int(lanes.ids[0])
    clear = ClearPlaces(lanes, 1.0 / 25.0)
    assert clear.before(track, 40).step == 30
    assert clear.after(track, 40).step == 50
    slow = ClearPlaces(lanes, 0.5)
    assert (slow.before(track, 40).step, slow.after(track, 40).step) == (38, 42)


def test_who_was_named_is_not_asked_whether_he_is_anybody() -> None:
    """A short life is asked about, until something is said that is said of people alone."""
    whole = sequence([(20, walk((-0.4, 0.0, 1.0), (0.2, 0.0, 1.0), 14))], 60)
    (asked,) = (one for one in queue(run_of(whole)).items if one.kind == "short")
    (named,) = propose("name", asked.places[:1], name="Anna")
    after = queue(run_of(whole, confirm((named,))))
    assert "short" not in [one.kind for one in after.items]
    assert after.answered > 0


# ── what is asked, by hand


@pytest.mark.parametrize("seed", range(8))
def test_what_hangs_on_a_place_is_every_row_by_the_odds_that_no_mistake_lies_between(
    seed: int,
) -> None:
    rng = np.random.default_rng(seed)
    paths = np.full((40, 2, 3), 1.0)
    paths[rng.random(40) < 0.2, 0] = np.nan
    lanes = TrackRows(world.tracks(paths))
    mistakes = [
        (1, int(at), int(at + rng.integers(1, 5)), float(rng.uniform(0.1, 1.0)))
        for at in rng.integers(-2, 42, 5)
    ]
    reach = IdentityReach(lanes, mistakes)
    frames = lanes.tracks.frames[lanes.rows[1]].tolist()
    parts = dict.fromkeys(range(len(frames)), 1.0)
    for _, before, after, wrong in mistakes:  # at the first row from the middle on
        place = next((k for k, f in enumerate(frames) if f >= (before + after + 1) // 2), 0)
        parts[place] *= 1.0 - wrong
    for step in (*frames[::6], frames[-1]):
        at = frames.index(step)
        heads = sum(float(np.prod([parts[m] for m in range(k + 1, at + 1)])) for k in range(at + 1))
        tails = sum(
            float(np.prod([parts[m] for m in range(at + 1, k + 1)])) for k in range(at, len(frames))
        )
        assert reach.before(1, step) == pytest.approx(heads)
        assert reach.after(1, step) == pytest.approx(tails)
    assert (reach.before(2, 9), reach.after(2, 9)) == (10.0, 31.0)
    assert (reach.before(1, -1), reach.after(1, 40)) == (0.0, 0.0)


def stretch(track: int, first: int, last: int, x: float) -> Tracklet:
    """Somebody who stands at x."""
    return Tracklet(track, Place(first, x, 0.0, 1.0), Place(last, x, 0.0, 1.0))


ONE, OTHER = stretch(1, 0, 10, 0.0), stretch(2, 0, 11, 1.0)
AFTER, ANOTHER = stretch(3, 20, 30, 0.1), stretch(4, 21, 30, 1.1)


@pytest.mark.parametrize(
    ("move", "words", "kinds", "pairs", "as_it_is"),
    [
        (Move((ONE,), (AFTER,), "join", 0.0), "1 goes on as 3", ["same"], [(10, 20)],
         [("different", (10, 20))]),
        (Move((ONE,), (AFTER,), "cut", 0.0), "two people", ["different"], [(10, 20)],
         [("same", (10, 20))]),
        (Move((ONE, OTHER), (AFTER, ANOTHER), "exchange", 0.0), "exchanged with 2", ["exchanged"],
         [(10, 21), (11, 20)], [("same", (10, 20)), ("same", (11, 21))]),
        (Move((ONE, OTHER), (AFTER,), "exchange", 0.0), "2 goes on as 3", ["same"], [(11, 20)],
         [("same", (10, 20))]),
        (Move((ONE,), (AFTER, ANOTHER), "exchange", 0.0), "1 goes on as 4", ["same"], [(10, 21)],
         [("same", (10, 20))]),
        # of one track, which comes first: it is exchanged with the one that it goes on as
        (Move((ONE, replace(OTHER, track=1)), (AFTER, ANOTHER), "exchange", 0.0),
         "exchanged with 4", ["exchanged"], [(10, 21), (11, 20)],
         [("same", (10, 20)), ("same", (11, 21))]),
        (Move((ONE,), (replace(AFTER, track=1),), "join", 0.0), "1 goes on", ["same"], [(10, 20)],
         [("different", (10, 20))]),
    ],
)  # fmt: skip
def test_what_a_move_says_otherwise_and_what_it_says_as_it_is(
    move: Move, words: str, kinds: list[str], pairs: list[tuple[int, int]],
    as_it_is: list[tuple[str, tuple[int, int]]],
) -> None:  # fmt: skip
    found = move.alternative
    assert found.words == words
    assert [one.kind for one in found.corrections] == kinds
    linked = [
        (a.step, b.step)
        for one in found.corrections
        for a, b in (*one.constraints.must_link, *one.constraints.cannot_link)
    ]
    assert linked[: len(pairs)] == pairs
    now = _as_it_is(move)
    assert [(one.kind, (one.places[0].step, one.places[1].step)) for one in now] == as_it_is
    assert move.stake([3.0, 4.0], [2.0, 9.0]) == 7.0
    assert move.stake([3.0, 4.0], [2.0]) == 2.0
    halves = [[c.places[0].step for c in half.corrections] for half in move.halves]
    assert halves == ([[10], [11]] if kinds == ["exchanged"] else [])


def test_moves_of_one_place_share_what_is_left_of_one_and_a_half_is_a_tenth() -> None:
    """exp(l) over 1 and the sum of all; of two that say the same the likelier counts."""
    exchange = Move((ONE, OTHER), (AFTER, ANOTHER), "exchange", -0.5)
    moves = [
        Move((ONE,), (AFTER,), "cut", 0.2), exchange, replace(exchange, log_odds=-2.0),
        Move((ONE,), (AFTER, ANOTHER), "exchange", -1.0),
    ]  # fmt: skip
    site = _Site.of(moves)
    total = 1.0 + np.exp(0.2) + np.exp(-0.5) + np.exp(-1.0)
    shares = [np.exp(0.2) / total, np.exp(-0.5) / total, np.exp(-1.0) / total]
    assert [one.probability for one in site.alternatives] == pytest.approx(shares)
    assert site.wrong == pytest.approx(sum(shares))
    assert site.move is exchange, "a cut is asked as what it may be instead"
    assert _Site.of(moves[:1]).move is moves[0]
    halves = _with_halves(site.moves, list(site.alternatives))
    assert [one.words for one in halves] == [
        "two people", "exchanged with 2", "1 goes on as 4", "2 goes on as 3"
    ]  # fmt: skip
    # the first half is there already
    assert [one.probability for one in halves] == pytest.approx(
        [shares[0], 0.9 * shares[1], shares[2], 0.1 * shares[1]]
    )
    both = _with_halves((exchange,), [site.alternatives[1]])
    assert [one.probability for one in both] == pytest.approx(
        [share * shares[1] for share in (0.8, 0.1, 0.1)]
    )
    assert _with_halves(site.moves, list(site.alternatives[:1])) == [site.alternatives[0]]


def asked(*corrections: Correction, first: int = 10, last: int = 20) -> ReviewItem:
    """What would be answered by corrections."""
    return ReviewItem(
        "join", "", "", first, last, (1, 3), (ONE.end, AFTER.begin), 0.5, 10,
        (Alternative("as it is", 0.5, ()), Alternative("other", 0.5, corrections)),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "late", "x", "answered"),
    [
        ("same", 0, 0.0, True), ("different", 0, 0.0, True), ("same", 5, 0.0, True),
        ("same", 6, 0.0, False), ("same", -5, 0.5, True), ("same", -6, 0.0, False),
        ("same", 0, 0.51, False), ("name", 0, 0.0, False), ("came", 0, 0.0, False),
    ],
)  # fmt: skip
def test_what_was_said_of_nearly_the_same_places_is_an_answer(
    kind: Kind, late: int, x: float, answered: bool
) -> None:
    (own,) = propose("same", (ONE.end, AFTER.begin))
    places = [place._replace(step=place.step + late, x=place.x + x)
              for place in (ONE.end, AFTER.begin)]  # fmt: skip
    told = propose(kind, places if kind in PAIRED else places[:1],
                   **({"name": "Anna"} if kind == "name" else {}))  # fmt: skip
    assert is_answered(asked(own), told, 5) is answered
    # both places must be near
    half = propose("same", (ONE.end, AFTER.begin._replace(x=3.0)))
    assert not is_answered(asked(own), half, 5)
    (came,) = propose("came", (AFTER.begin,))
    assert is_answered(asked(came), (came,), 5)
    assert not is_answered(asked(came), propose("left", (AFTER.begin,)), 5)


@pytest.mark.parametrize(
    ("first", "last", "answered"), [(10, 20, True), (11, 20, False), (10, 19, False), (0, 99, True)]
)
def test_what_lies_in_steps_that_were_checked_is_answered(
    first: int, last: int, answered: bool
) -> None:
    said = [make(kind="checked", first=first, last=last)]
    assert is_answered(asked(), said, 5) is answered


def test_two_of_one_pair_within_a_moment_are_one_question() -> None:
    def one(first: int, last: int, x: float, stake: int = 10) -> ReviewItem:
        (own,) = propose("came", (Place(first, x, 0.0, 1.0),))
        item = replace(asked(own, first=first, last=last), stake=stake)
        return replace(item, places=own.places)

    first = one(10, 20, 0.0)
    for begin, end, told in ((20, 30, False), (21, 30, True), (2, 10, False), (2, 9, True)):
        second = replace(one(begin, end, 5.0), tracks=(3, 1))
        assert list(once_each([first, second])) == [first, *([second] if told else [])]
    third = replace(one(12, 20, 5.0), tracks=(1, 4))
    assert list(once_each([first, third])) == [first, third]
    assert list(once_each([first, replace(third, places=first.places)])) == [first]
    exactly, less = one(10, 20, 0.0, stake=2), replace(first, probability=0.499, stake=2)
    assert list(once_each([exactly])) == [exactly]
    assert not list(once_each([less]))
    same = replace(first, alternatives=(first.alternatives[0], Alternative("", 0.5, propose(
        "same", (ONE.end, AFTER.begin)))))  # fmt: skip
    again = replace(same, tracks=(7,), places=(ANOTHER.begin,))
    assert list(once_each([same, again])) == [same]


# ── the same recording as another run sees it


def lines(*spans: tuple[int, int, float], steps: int = 60) -> ndarray:
    """First and last step and x of people who stand."""
    paths = np.full((steps, len(spans), 3), np.nan)
    for person, (first, last, x) in enumerate(spans):
        paths[first : last + 1, person] = [x, 0.0, 1.0]
    return paths


def test_the_other_runs_person_is_the_most_frequent_of_a_while_within_its_reach() -> None:
    tracks = world.tracks(lines((0, 59, 0.0), (0, 59, 3.0)))
    other = world.tracks(lines((0, 24, 0.69), (25, 59, 0.69), (0, 59, 3.71)), ids=[7, 8, 9])
    seen = OtherRun(tracks, other, 0.1)
    assert set(seen.ids[tracks.ids == 2]) == {-1}
    own = seen.ids[tracks.ids == 1]
    assert own.tolist() == [7] * 25 + [8] * 35
    # of the eighteen steps up to a place, or from it on; of as many of both the first
    for step, before, name in (
        (24, True, 7), (33, True, 7), (34, True, 8), (25, False, 8), (16, False, 7), (17, False, 8),
    ):  # fmt: skip
        assert seen.at(1, Place(step, 0.0, 0.0, 1.0), before=before) == name
    assert seen.at(2, Place(30, 3.0, 0.0, 1.0), before=True) == -1


@pytest.mark.parametrize(
    ("who", "kind", "earlier", "later", "added"),
    [
        # 7 goes on as 7 across the place, and so does 8
        ("7788", "join", [1], [3], 2.5), ("7788", "cut", [1], [3], -2.5),
        ("7878", "join", [1], [3], -2.5), ("7878", "cut", [1], [3], 2.5),
        ("7.88", "join", [1], [3], 0.0),
        ("7788", "exchange", [1, 2], [3, 4], -2.5), ("7887", "exchange", [1, 2], [3, 4], 2.5),
        ("7887", "exchange", [1], [3, 4], 2.5), ("7788", "exchange", [1], [3, 4], -2.5),
        ("7887", "exchange", [1, 2], [3], 2.5), ("7788", "exchange", [1, 2], [3], -2.5),
        ("7999", "exchange", [1, 2], [3, 4], 0.0), ("7..7", "exchange", [1, 2], [3, 4], 2.5),
    ],
)  # fmt: skip
def test_a_move_gains_what_the_other_run_says_of_who_goes_on(
    who: str, kind: ItemKind, earlier: list[int], later: list[int], added: float
) -> None:
    """``who`` names the tracks 1, 3, 2 and 4 there; here 1 goes on as 3 and 2 as 4."""
    tracks = world.tracks(lines((0, 24, 0.0), (0, 24, 2.0), (35, 59, 0.0), (35, 59, 2.0)))
    names = dict(zip((1, 3, 2, 4), who, strict=True))
    seen = OtherRun(tracks, tracks, 0.1)
    seen.ids[:] = [-1 if names[k] == "." else int(names[k]) for k in tracks.ids.tolist()]
    lanes = TrackRows(tracks)
    pieces = {k: Tracklet(k, lanes.of_row(int(rows[0])), lanes.of_row(int(rows[-1])))
              for k, rows in lanes.rows.items()}  # fmt: skip
    move = Move(tuple(pieces[k] for k in earlier), tuple(pieces[k] for k in later), kind, 0.7)
    assert seen.with_evidence(move).log_odds == pytest.approx(0.7 + added)


def test_the_other_run_tells_joins_and_exchanges_of_stretches_that_last() -> None:
    spans = (0, 24, 0.0), (35, 59, 0.0), (0, 59, 2.0)
    tracks = world.tracks(lines(*spans))
    seen = OtherRun(tracks, tracks, 0.1)

    def moves_with(names: dict[int, list[int]]) -> list[tuple[str, list[int], list[int]]]:
        for track, own in names.items():
            seen.ids[tracks.ids == track] = own
        return [(m.kind, [p.track for p in m.earlier], [p.track for p in m.later])
                for m in seen.moves()]  # fmt: skip

    assert moves_with({1: [7] * 25, 2: [7] * 25, 3: [8] * 60}) == [("join", [1], [2])]
    assert all(m.log_odds == -2.5 for m in seen.moves())
    # the third is somebody else for a while: too briefly, or as long as it must
    brief = [8] * 30 + [9] * 5 + [8] * 25
    assert moves_with({1: [7] * 25, 2: [7] * 25, 3: brief}) == [("join", [1], [2])]
    assert moves_with({1: [7] * 25, 2: [-1] * 25, 3: [8] * 30 + [7] * 6 + [8] * 24}) == [
        ("exchange", [3, 1], [3])
    ]
    assert moves_with({1: [7] * 25, 2: [8] * 25, 3: [8] * 30 + [7] * 30}) == [
        ("exchange", [3, 1], [3]), ("exchange", [3], [3, 2])
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("move", "title", "why"),
    [
        (Move((ONE,), (AFTER,), "join", 0.0), "Track 1 goes on as track 3?",
         "track 1 ends and track 3 begins 0.5 m away, 1.0 s later"),
        (Move((ONE,), (replace(AFTER, track=1),), "cut", 0.0), "Track 1 is two people?",
         "after step 10 it goes on at the same place, 1.0 s later"),
        (Move((ONE, OTHER), (AFTER, ANOTHER), "exchange", 0.0), "Tracks 1 and 4 exchanged?",
         "track 4 is where track 1 may have gone on, 2.0 m away, 1.1 s later"),
        (Move((ONE, OTHER), (replace(OTHER, track=2), replace(AFTER, track=1)), "exchange", 0.0),
         "Tracks 1 and 2 exchanged?", "track 2 fits what track 1 does from step 20 on"),
        (Move((ONE,), (replace(AFTER, track=1), replace(ANOTHER, track=1)), "exchange", 0.0),
         "Track 1 goes on elsewhere?",
         "another piece of track 1 fits, at the same place, 1.1 s later"),
        (Move((ONE,), (replace(AFTER, begin=Place(5, 0.1, 0.0, 1.0)),), "join", 0.0),
         "Track 1 goes on as track 3?",
         "track 1 ends and track 3 begins 0.5 m away, 0.5 s before that"),
        (Move((ONE,), (AFTER,), "gap", 0.0, "because", "a title"), "a title", "because"),
    ],
)  # fmt: skip
def test_what_is_asked_in_words(move: Move, title: str, why: str) -> None:
    tracks = world.tracks(lines((0, 29, 0.0), (0, 29, 1.0), (5, 29, 0.5), (0, 29, 2.0)))
    run = cast("Any", SimpleNamespace(tracks=tracks, sequence=SimpleNamespace(step_time=0.1)))
    assert words_of(run, move) == (title, why)


def test_a_question_has_the_odds_of_all_its_moves_and_the_rows_that_hang_on_them() -> None:
    tracks = world.tracks(lines((0, 10, 0.0), (0, 11, 1.0), (20, 59, 0.1), (21, 30, 1.1)))
    run = cast("Any", SimpleNamespace(tracks=tracks, sequence=SimpleNamespace(step_time=0.1)))
    reach = IdentityReach(TrackRows(tracks), [])
    exchange = Move((ONE, OTHER), (AFTER, ANOTHER), "exchange", 1.0)
    goes_on = Move((ONE,), (AFTER, ANOTHER), "exchange", 0.0)
    site = _Site.of([goes_on, exchange])
    item = _item_of(run, site, reach)
    assert item is not None
    total = 2.0 + np.e
    assert item.probability == pytest.approx((1.0 + np.e) / total)
    # the lesser of what is before and what is after: min(11 + 12, 40 + 10), min(11, 40 + 10)
    assert item.stake == round((np.e * 23 + 11) / (np.e + 1.0))
    assert (item.first, item.last, item.tracks) == (10, 21, (1, 2, 3, 4))
    assert [place.step for place in item.places] == [10, 11, 20, 21]
    now, *others = item.alternatives
    assert (now.words, now.probability) == ("as it is", pytest.approx(1.0 / total))
    assert [one.words for one in others] == [
        "exchanged with 2", "1 goes on as 4", "2 goes on as 3", "none of these"
    ]  # fmt: skip
    assert [one.probability for one in others] == pytest.approx(
        [0.9 * np.e / total, 1.0 / total, 0.1 * np.e / total, 0.0]
    )
    moment = replace(ONE, moment=7), replace(AFTER, moment=9)
    apart = _item_of(run, _Site.of([Move(moment[:1], moment[1:], "join", 0.0)]), reach)
    assert apart is not None
    assert (apart.first, apart.last, apart.stake) == (7, 9, 8)
    # nothing else can be said of places in the wrong order
    late = Move((replace(ONE, end=Place(30, 0.0, 0.0, 1.0)),), (AFTER,), "join", 0.0)
    assert _item_of(run, _Site.of([late]), reach) is None


def test_so_many_are_asked_and_all_that_are_answered_are_counted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    tracks = world.tracks(lines((0, 20, 0.0), (30, 59, 0.1), (0, 59, 1.5)))
    run = Run(world.sequence(world.ring(3), lines((0, 59, 0.0))), RunParameters(), 0, {})
    run.done, run.tracks, run.filtered = 60, tracks, tracks
    run.tracks = replace(tracks, seen=np.ones((len(tracks), 3), dtype=bool))
    run.views = Steps.of([(ViewResult.of_no_frame(),) * 3] * 60, ViewResult, 3)
    whole = queue(run)
    assert len(whole.items) > 2
    assert whole.answered == 0
    assert whole.how == (
        "where tracks end and begin; moments with less than 1 expected wrong step are left out"
    )
    first = whole.items[0]
    rest = queue(run, corrections=first.alternatives[0].corrections)
    assert rest.answered >= 1
    assert first.id not in [one.id for one in rest.items]
    monkeypatch.setattr("tracker.review.queue.ranking.MOST", 2)
    assert queue(run).items == whole.items[:2]
    backwards = queue(run, tracks)
    assert "backwards in time" in backwards.how
