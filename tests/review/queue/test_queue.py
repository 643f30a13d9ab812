"""The queue of doubtful places: what is at stake first, and what was settled no more."""

from __future__ import annotations

import numpy as np
import pytest

from tests.conftest import short
from tests.engine.synthetic import crossing, sequence, walk
from tests.runs.test_corrected_runs import run_of, with_a_gap
from tracker.corrections import Place
from tracker.corrections.kinds import Kind
from tracker.fusion.trajectories import Trajectories, apply_corrections
from tracker.review.queue import queue
from tracker.review.queue.clear_places import ClearPlaces
from tracker.review.queue.item import Alternative, TrackRows, confirm, propose
from tracker.review.queue.linking import Move, Tracklet
from tracker.review.queue.other_run import OtherRun
from tracker.review.queue.ranking import IdentityReach, _with_none_of_them

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
    one = walk((-1.1, 0.0, 1.0), (1.1, 0.0, 1.0), 80)
    other = walk((0.0, -1.5, 1.0), (0.0, 1.5, 1.0), 80)
    run = run_of(sequence([(0, one), (0, other)], 80))
    lanes = TrackRows(run.tracks)
    track, third = (int(name) for name in lanes.ids)
    clear = ClearPlaces(lanes, 1.0 / 25.0, 0.25)
    apart = np.linalg.norm((one - other)[:, :2], axis=1)
    near = np.flatnonzero(apart < 1.0)
    before, after = clear.before(track, 40), clear.after(track, 40)
    assert abs(before.step - (near[0] - 1)) <= 2
    assert abs(after.step - (near[-1] + 1)) <= 2
    assert clear.before(third, 3).step == 3


def test_what_hangs_on_a_moment_ends_where_the_next_mistake_may_be() -> None:
    run = run_of(sequence([(0, walk((-1.1, 0.0, 1.0), (1.1, 0.0, 1.0), 60))], 60))
    lanes = TrackRows(run.tracks)
    track = int(lanes.ids[0])
    first, last = lanes.span(track)
    whole = IdentityReach(lanes, [])
    assert whole.before(track, last) == whole.after(track, first) == last - first + 1
    half = IdentityReach(lanes, [(track, 19, 20, 0.5)])
    assert half.before(track, 39) == pytest.approx(20 + 0.5 * (20 - first))
    assert half.after(track, 10) == pytest.approx(10 + 0.5 * (last - 19))
    assert half.after(track, 20) == last - 19


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
    clear = ClearPlaces(lanes, 1.0 / 25.0, 0.25)
    assert clear.before(track, 40).step == 30
    assert clear.after(track, 40).step == 50
    slow = ClearPlaces(lanes, 0.5, 0.25)
    assert (slow.before(track, 40).step, slow.after(track, 40).step) == (38, 42)


def test_who_was_named_is_not_asked_whether_he_is_anybody() -> None:
    """A short life is asked about, until something is said that is said of people alone."""
    whole = sequence([(20, walk((-0.4, 0.0, 1.0), (0.2, 0.0, 1.0), 14))], 60)
    (asked,) = (one for one in queue(run_of(whole)).items if one.kind == "short")
    (named,) = propose("name", asked.places[:1], name="Anna")
    after = queue(run_of(whole, confirm((named,))))
    assert "short" not in [one.kind for one in after.items]
    assert after.answered > 0
