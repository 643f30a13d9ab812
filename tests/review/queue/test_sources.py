"""Where doubts come from: people who meet, boxes that nobody takes, ends inside the room."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest

from tests.engine.synthetic import HALF_EXTENTS, sequence, walk
from tests.runs.test_corrected_runs import run_of
from tracker.corrections import Place
from tracker.fusion.trajectories import Trajectories
from tracker.review.queue import queue
from tracker.review.queue.item import Alternative, ReviewItem, TrackRows, confirm, propose
from tracker.review.queue.meetings import ambiguous_shares, meetings
from tracker.review.queue.ranking import is_answered, once_each
from tracker.review.queue.unclaimed import find_unclaimed
from tracker.runs.run import Run
from tracker.steps.steps import Ragged, Steps


def without(run: Run, track: int, first: int = 0, last: int = 10**6) -> Run:
    """The run as if a track had not been found at some steps."""
    tracks = run.tracks
    gone = (tracks.ids == track) & (tracks.frames >= first) & (tracks.frames <= last)
    other = replace(run)
    other.tracks, other.done, other.views = tracks.take(~gone), run.done, run.views
    other.fused, other.smoothed = run.fused, None
    return other


def two() -> Run:
    one = walk((-1.2, 0.5, 1.0), (1.2, 0.6, 1.0), 80)
    other = walk((1.2, -0.7, 1.0), (-1.2, -0.6, 1.0), 80)
    return run_of(sequence([(0, one), (0, other)], 80))


def near() -> Run:
    """Two who pass each other as near as they can without touching."""
    one = walk((-1.2, 0.14, 1.0), (1.1, 0.14, 1.0), 60)
    other = walk((1.2, -0.14, 1.0), (-1.1, -0.14, 1.0), 60)
    return run_of(sequence([(0, one), (0, other)], 60))


def exchanged(tracks: Trajectories, step: int) -> Trajectories:
    """Two tracks, exchanged from a step on."""
    ids, names, late = tracks.ids.copy(), np.unique(tracks.ids), tracks.frames >= step
    ids[late] = np.where(ids[late] == names[0], names[1], names[0])
    changed = replace(tracks, ids=ids)
    return changed.take(np.lexsort((ids, tracks.frames)))


def test_who_goes_straight_on_is_himself_and_who_turns_back_was_exchanged() -> None:
    run = near()
    straight = [
        one.log_odds for one in meetings(run, TrackRows(run.tracks)) if len(one.earlier) == 2
    ]
    assert straight
    run.tracks = exchanged(run.tracks, 30)
    turned = [one.log_odds for one in meetings(run, TrackRows(run.tracks)) if len(one.earlier) == 2]
    assert min(turned) > max(straight) + 2.0


def test_boxes_are_drawn_between_people_no_more_than_they_are() -> None:
    run = near()
    shares = ambiguous_shares(run)
    assert all(0.0 < share <= 1.0 for share in shares.values())
    assert all(one < other for one, other, _ in shares)


class Growing:
    """The filter's results of a run that is being computed: there are more at every look."""

    def __init__(self, results: Steps[Any]) -> None:
        self._results, self._there = results, 30

    def __len__(self) -> int:
        return self._there

    def column(self, name: str, **part: int) -> Ragged:
        self._there += 5
        return self._results.before(self._there).column(name, **part)


def test_a_run_that_grows_while_it_is_read_is_read_as_far_as_it_was() -> None:
    run = near()
    whole = ambiguous_shares(run)
    growing = replace(run)
    growing.tracks, growing.fused = run.tracks, cast("Any", Growing(run.fused))
    found = ambiguous_shares(growing)
    assert found == {key: share for key, share in whole.items() if key[2] < 30}


def test_who_is_missing_is_asked_for_with_where_he_is() -> None:
    run = two()
    assert find_unclaimed(run) == []
    assert not [one for one in queue(run).items if one.kind == "missing"]
    gone = int(run.tracks.ids[0])
    own = run.tracks.ids == gone
    path = dict(zip(run.tracks.frames[own].tolist(), run.tracks.positions[own], strict=True))
    found = find_unclaimed(without(run, gone))
    assert len(found) == 1
    away = [
        np.hypot(*(place.point - path[place.step])[:2])
        for place in found[0].places
        if place.step in path
    ]
    assert len(away) > 70
    assert max(away) < HALF_EXTENTS[0]
    told = [one for one in queue(without(run, gone)).items if one.kind == "missing"]
    assert len(told) == 1
    assert told[0].tracks == ()
    now, other = told[0].alternatives
    assert [one.kind for one in now.corrections] == ["nobody"]
    assert {one.kind for one in other.corrections} == {"here"}
    assert other.probability == told[0].probability > 0.5


@pytest.mark.parametrize(("first", "last", "kind"), [(0, 39, "begins"), (40, 99, "ends")])
def test_a_track_that_begins_or_ends_inside_is_asked_for(first: int, last: int, kind: str) -> None:
    run = two()
    track = int(run.tracks.ids[0])
    cut = without(run, track, first, last)
    cut.views = run.views.alike(
        tuple(replace(view, boxes=view.boxes[:0]) for view in step)
        if first <= number <= last
        else step
        for number, step in enumerate(run.views)
    )
    told = [one for one in queue(cut).items if one.kind == kind]
    assert [one.tracks for one in told] == [(track,)]
    now, other = told[0].alternatives
    assert now.corrections[0].kind == {"begins": "came", "ends": "left"}[kind]
    assert other.corrections[0].kind == "here"
    assert is_answered(told[0], confirm(now.corrections), 25)
    assert not [one for one in queue(two()).items if one.kind in ("begins", "ends")]


def test_a_place_is_told_once_and_only_where_something_is_at_stake() -> None:
    place = Place(30, 0.0, 0.0, 1.0)

    def doubt(tracks: tuple[int, ...], first: int, stake: int, x: float) -> ReviewItem:
        other = replace_place(place, x)
        return ReviewItem(
            "exchange", "", "", first, first + 4, tracks, (place, other), 0.5, stake,
            (Alternative("as it is", 0.5, ()), Alternative("other", 0.5, propose("name", [other],
                                                                               name="A"))),
        )  # fmt: skip

    first, mirrored = doubt((1, 2), 30, 80, 0.1), doubt((2, 1), 40, 60, 0.2)
    later, others = doubt((2, 1), 120, 50, 0.3), doubt((1, 3), 31, 40, 0.4)
    little = doubt((4,), 31, 1, 0.5)
    told = list(once_each([first, mirrored, later, others, little], 25))
    assert told == [first, later, others]


def replace_place(place: Place, x: float) -> Place:
    return place._replace(x=x)
