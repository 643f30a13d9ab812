"""Where doubts come from: people who meet, boxes that nobody takes, ends inside the room."""

from __future__ import annotations

import itertools
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from numpy import ndarray

from tests import world
from tests.engine.synthetic import HALF_EXTENTS, sequence, walk
from tests.runs.test_corrected_runs import run_of
from tracker.corrections import Place
from tracker.parameters.catalogue import RunParameters
from tracker.review.queue import queue, single_tracks, track_ends
from tracker.review.queue.clear_places import ClearPlaces
from tracker.review.queue.item import TrackRows, confirm
from tracker.review.queue.links import moves_of_links, tracklets_of
from tracker.review.queue.lost_people import joins_of_lost_people, leaving_probability
from tracker.review.queue.meetings import meetings
from tracker.review.queue.moves import Tracklet
from tracker.review.queue.ranking import is_answered
from tracker.review.queue.unclaimed import Unclaimed, _chains, find_unclaimed
from tracker.runs.run import Run
from tracker.sequences.sequence import Room
from tracker.single_view.protocol import ViewResult
from tracker.smoothing.protocol import LinkedTracklets
from tracker.steps.steps import Steps


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


# ── by their formulas, on tracks that are made up


NO_BOXES = ViewResult.of_boxes(np.zeros((0, 4)), np.zeros(0), np.zeros((0, 4)))


def scene(
    paths: ndarray, *, fps: float = 10.0, room: Room | None = None, frames: int | None = None
) -> Run:
    """A run of boxes that has these tracks, (steps, people, 3), seen by all of three cameras."""
    steps = np.concatenate([paths, np.full((max((frames or 0) - len(paths), 0), 1, 3), np.nan)],
                           axis=0) if paths.shape[1] == 1 else paths  # fmt: skip
    whole = world.sequence(world.ring(3), steps, fps=fps, room=room)
    run = Run(whole, RunParameters(), 0, {})
    run.done = len(steps)
    run.tracks = run.filtered = world.tracks(steps, cameras=3)
    return run


def standing(*spans: tuple[int, int, float, float], steps: int = 100) -> ndarray:
    """First and last step, x and y of people who stand."""
    paths = np.full((steps, len(spans), 3), np.nan)
    for person, (first, last, x, y) in enumerate(spans):
        paths[first : last + 1, person] = [x, y, 0.85]
    return paths


def log_odds(probability: float) -> float:
    return float(np.log(probability / (1.0 - probability)))


@pytest.mark.parametrize("seed", range(12))
def test_odds_of_other_links_are_those_of_all_chains_before_and_after(seed: int) -> None:
    """Births, links and ends of all chains summed up, with the move and without."""
    rng = np.random.default_rng(seed)
    count = 7
    firsts = np.arange(count) * 10
    labels = rng.integers(1, 4, count)
    births, deaths = rng.normal(-3.0, 2.0, (2, count))
    pairs = [(i, j) for i, j in itertools.combinations(range(count), 2) if rng.random() < 0.6]
    gains = dict(zip(pairs, rng.normal(-2.0, 4.0, len(pairs)).tolist(), strict=True))
    earlier, later = np.array(pairs).T
    lost = int(rng.integers(count))
    places = [Place(int(first), 0.0, 0.0, 1.0) for first in firsts]
    tracklets = [
        None if k == lost else Tracklet(int(label), place, place._replace(step=place.step + 5))
        for k, (label, place) in enumerate(zip(labels, places, strict=True))
    ]
    nowhere = np.zeros((count, 3))
    joined = LinkedTracklets(
        labels, firsts, firsts + 5, nowhere, nowhere, np.zeros(count), births, deaths,
        earlier, later, np.array(list(gains.values())),
    )  # fmt: skip
    known = [k for k in range(count) if k != lost]
    now: dict[int, int] = {}
    for label in set(labels.tolist()):
        now |= dict(itertools.pairwise([k for k in known if labels[k] == label]))

    def total(following: dict[int, int]) -> float:
        odds = sum(births[k] for k in known if k not in following.values())
        odds += sum(deaths[k] for k in known if k not in following)
        return float(odds) + sum(
            gains.get((i, j), float(deaths[i] + births[j])) for i, j in following.items()
        )

    expected: dict[tuple[str, int, int], float] = {}
    for i, j in pairs:
        if lost not in (i, j) and now.get(i) != j:
            after = {a: b for a, b in now.items() if a != i and b != j} | {i: j}
            before = next((a for a, b in now.items() if b == j), None)
            if before is not None and i in now:
                after[before] = now[i]
            kind = "exchange" if before is not None or i in now else "join"
            expected[kind, i, j] = total(after) - total(now)
    for i, j in now.items():
        expected["cut", i, j] = total({a: b for a, b in now.items() if a != i}) - total(now)
    found = {}
    for move in moves_of_links(tracklets, joined):
        one, other = move.earlier[0], move.later[-1]
        if len(move.earlier) == 2 and len(move.later) == 1:
            one = move.earlier[1]
        found[move.kind, one.begin.step // 10, other.begin.step // 10] = 3.0 * move.log_odds
    assert found == pytest.approx({k: odds for k, odds in expected.items() if odds > -21.0})


def test_who_is_lost_may_be_whoever_begins_later_as_likely_as_by_the_formula() -> None:
    """Each against all others who may be the one, and against who left or came."""
    room = world.volume(2.2, entrances=[(0.0, 0.4, 0.85)])
    spans = [
        (0, 10, 0.0, -1.0), (0, 14, 0.5, -1.0), (50, 70, 0.2, -0.8), (51, 99, 0.3, 0.3),
        (20, 40, 1.9, 0.0), (18, 44, 0.4, -1.2), (0, 99, -1.0, -1.0), (15, 90, 0.6, -1.1),
    ]  # fmt: skip
    run = scene(standing(*spans), fps=2.0, room=room)
    ends = [(k, s) for k, s in enumerate(spans) if s[1] < 99]
    begins = [(k, s) for k, s in enumerate(spans) if s[0] > 0]
    leaves = {k: 0.9 if k in (3, 4) else 0.2 for k in range(len(spans))}
    left, came = np.zeros((len(ends), len(begins))), np.zeros((len(ends), len(begins)))
    for a, (i, end) in enumerate(ends):
        for b, (j, begin) in enumerate(begins):
            seconds = (begin[0] - end[1]) / 2.0
            if not 0.0 < seconds <= 20.0:
                continue
            spread = 0.4**2 + 0.6**2 * seconds * min(seconds, 4.0)
            apart = (begin[2] - end[2]) ** 2 + (begin[3] - end[3]) ** 2
            density = np.exp(-0.5 * apart / spread - seconds / 20.0) / (2.0 * np.pi * spread)
            left[a, b] = (1.0 - leaves[i]) * density
            came[a, b] = (1.0 - leaves[j]) * density
    expected = {}
    for a, (i, _) in enumerate(ends):
        for b, (j, _) in enumerate(begins):
            if left[a, b] > 0.0:
                others = np.delete(left[a], b).sum() + leaves[i] / 4.4**2
                before = np.delete(came[:, b], a).sum() + leaves[j] / 4.4**2
                odds = float(np.log(min(left[a, b] / others, came[a, b] / before)))
                if odds > -3.5:
                    expected[i + 1, j + 1] = odds
    lanes = TrackRows(run.tracks)
    found = {
        (m.earlier[0].track, m.later[0].track): m.log_odds
        for m in joins_of_lost_people(run, lanes, set())
    }
    assert len(expected) > 6
    assert found == pytest.approx(expected, abs=1e-6)
    one, other = next(iter(found))
    asked = {(lanes.of_row(int(lanes.rows[one][-1])), lanes.of_row(int(lanes.rows[other][0])))}
    assert len(list(joins_of_lost_people(run, lanes, asked))) == len(found) - 1
    alone = scene(standing((0, 99, 0.0, 0.0)))
    assert not list(joins_of_lost_people(alone, TrackRows(alone.tracks), set()))


@pytest.mark.parametrize(
    ("x", "y", "leaves"),
    [(0.0, -1.0, 0.2), (1.69, 0.0, 0.2), (1.71, 0.0, 0.9), (0.0, -1.71, 0.9),
     (0.49, 1.0, 0.9), (0.51, 1.0, 0.2), (0.0, 0.29, 0.9), (0.0, 0.27, 0.2)],
)  # fmt: skip
def test_people_leave_within_half_a_metre_of_an_edge_or_two_sigmas_of_a_door(
    x: float, y: float, leaves: float
) -> None:
    """A door at (0, 1) that is known to nothing along x, and to 0.11 m along y."""
    room = world.volume(2.2, entrances=[(0.0, 1.0, 0.85)], sigma=(0.0, 0.11, 0.1))
    run = scene(standing((0, 99, 0.0, 0.0)), room=room)
    assert leaving_probability(Place(3, x, y, 0.85), run) == leaves


def meeting_of(speed: float, apart: float = 0.2, steps: int = 41) -> Run:
    """Two who walk past each other in the middle of the time."""
    x = speed * 0.1 * (np.arange(steps) - steps // 2)
    one = np.stack([x, np.full(steps, apart / 2.0), np.full(steps, 0.85)], axis=1)
    return scene(np.stack([one, one * [-1.0, -1.0, 1.0]], axis=1))


@pytest.mark.parametrize(("speed", "turned"), [(0.3, -1.0), (0.6, -4.0)])
def test_a_meeting_is_as_doubtful_as_it_is_near_and_by_how_straight_both_go(
    speed: float, turned: float
) -> None:
    """v · v' over 0.6² of the relative velocities half a second before and after."""
    run = meeting_of(speed)
    found = list(meetings(run, TrackRows(run.tracks)))
    wrong = 0.12 * np.exp(-0.2 / 0.6)
    both = [m for m in found if len(m.earlier) == 2]
    single = [m for m in found if len(m.earlier) == 1]
    assert [m.log_odds for m in both] == pytest.approx([log_odds(wrong) + turned] * 2)
    assert [m.log_odds for m in single] == pytest.approx([log_odds(wrong) + turned - 1.5] * 2)
    assert [m.earlier[0].track for m in both] == [1, 2]
    # from the step before the first that is nearer than two widths to the one after the last
    apart = np.hypot(2.0 * run.tracks.positions[::2, 0], 0.2)
    near = np.flatnonzero(apart < 1.2)
    assert {one.last for m in both for one in m.earlier} == {near[0] - 1}
    assert {one.first for m in both for one in m.later} == {near[-1] + 1}
    assert found[0].title == "Tracks 1 and 2 pass within 0.20 m"
    assert found[0].why == "nearest at step 20"


def test_of_who_meets_at_an_end_the_way_tells_nothing_and_apart_are_two_meetings() -> None:
    run = meeting_of(0.3, steps=9)
    wrong = 0.12 * np.exp(-0.2 / 0.6)
    assert next(iter(meetings(run, TrackRows(run.tracks)))).log_odds == pytest.approx(
        log_odds(wrong)
    )
    for pause, count in ((9, 1), (10, 2)):  # of more than a second
        paths = standing((0, 39, 0.0, 0.0), (0, 39, 0.5, 0.0), steps=40)
        paths[10 : 10 + pause, 1, 0] = 1.3
        again = scene(paths)
        found = [m for m in meetings(again, TrackRows(again.tracks)) if len(m.earlier) == 2]
        assert len(found) == 2 * count, pause
    for pause, count in ((1, 1), (2, 2)):  # where a step is a second, of more than two steps
        paths = standing((0, 9, 0.0, 0.0), (0, 9, 0.5, 0.0), steps=10)
        paths[4 : 4 + pause, 1, 0] = 1.3
        slow = scene(paths, fps=1.0)
        assert len(list(meetings(slow, TrackRows(slow.tracks)))) == 4 * count
    edge = scene(standing((0, 9, 0.0, 0.0), (0, 9, 1.2, 0.0), steps=10))
    assert not list(meetings(edge, TrackRows(edge.tracks)))


def test_what_is_asked_of_is_the_nearest_place_where_the_track_stands_clear() -> None:
    """By going through the steps one after another, of four who wander about."""
    rng = np.random.default_rng(3)
    paths = np.cumsum(rng.normal(0.0, 0.3, (90, 4, 3)) * [1.0, 1.0, 0.0], axis=0)
    paths[60:75, 0] = np.nan
    run = scene(paths + np.array([0.0, 0.0, 0.85]))
    seen = rng.random((len(run.tracks), 3)) < 0.4
    run.tracks = tracks = replace(run.tracks, seen=seen)
    lanes = TrackRows(tracks)
    clear = ClearPlaces(lanes, 0.1)

    def gap(row: int) -> float:
        others = (tracks.frames == tracks.frames[row]) & (np.arange(len(tracks)) != row)
        away = np.linalg.norm(tracks.positions[others, :2] - tracks.positions[row, :2], axis=1)
        return float(away.min()) if seen[row].any() else 0.0

    for track, step, after in itertools.product((1, 2), (0, 3, 30, 58, 62, 74, 89), (False, True)):
        sign = 1 if after else -1
        away = {int(r): sign * (int(tracks.frames[r]) - step) for r in lanes.rows[track]}
        own = sorted((r for r, k in away.items() if 0 <= k <= 50), key=lambda r: away[r])
        own = [r for r in own if away[r] >= 4] or own
        far = [r for r in own if gap(r) >= 2.0]
        found = (clear.after if after else clear.before)(track, step)
        if own:
            assert found == lanes.of_row(far[0] if far else max(own, key=gap)), (track, step)
        else:
            assert found == lanes.place(track, step, after=after)


@pytest.mark.parametrize(("away", "clear"), [(49, True), (50, True), (51, False)])
def test_a_clear_place_is_looked_for_within_five_seconds(away: int, clear: bool) -> None:
    """Two who stand side by side but for one step."""
    paths = standing((0, 120, 0.0, 0.0), (0, 120, 0.3, 0.0), steps=121)
    for at in (60 - away, 60 + away):
        paths[at, 1, 0] = 2.1
    lanes = TrackRows(scene(paths).tracks)
    found = ClearPlaces(lanes, 0.1)
    before, after = found.before(1, 60).step, found.after(1, 60).step
    assert (before, after) == ((60 - away, 60 + away) if clear else (56, 64))


def test_rows_of_a_track_are_counted_and_found_by_step() -> None:
    paths = standing((2, 9, 0.0, 0.0), (0, 20, 1.0, 0.0), steps=21)
    paths[5:7, 0] = np.nan
    lanes = TrackRows(scene(paths).tracks)
    assert (lanes.span(1), lanes.count(1), lanes.count(1, 4), lanes.count(1, 3, 7)) == (
        (2, 9), 6, 4, 3
    )  # fmt: skip
    assert (lanes.count(1, 5, 6), lanes.count(1, 9, 3)) == (0, 0)
    before = [lanes.place(1, step).step for step in (0, 2, 4, 5, 6, 7, 30)]
    after = [lanes.place(1, step, after=True).step for step in (0, 2, 4, 5, 6, 7, 30)]
    assert before == [2, 2, 4, 4, 4, 7, 9]
    assert after == [2, 2, 4, 7, 7, 7, 9]


@pytest.mark.parametrize("within", [0.05, 0.3])
def test_a_way_with_fewer_places_leads_past_none_farther_than_is_said(within: float) -> None:
    rng = np.random.default_rng(6)
    paths = np.cumsum(rng.normal(0.0, 0.1, (60, 1, 3)), axis=0)
    lanes = TrackRows(scene(paths).tracks)
    places = lanes.simplified_path(lanes.rows[1], within)
    steps = [place.step for place in places]
    assert (steps[0], steps[-1]) == (0, 59)
    for a, b in itertools.pairwise(steps):
        share = (np.arange(a, b + 1) - a)[:, None] / (b - a)
        way = (1.0 - share) * paths[a, 0, :2] + share * paths[b, 0, :2]
        assert np.linalg.norm(paths[a : b + 1, 0, :2] - way, axis=1).max() <= within
    straight = TrackRows(scene(np.linspace(0.0, 1.0, 30)[:, None, None] * np.ones(3)).tracks)
    assert [p.step for p in straight.simplified_path(straight.rows[1], 0.01)] == [0, 29]
    bent = np.zeros((11, 1, 3))
    bent[:, 0, 1] = 0.5 - np.abs(np.arange(11) - 5.0) / 10.0
    for most, corner in ((0.499, [5]), (0.501, [])):
        lanes = TrackRows(scene(bent).tracks)
        assert [p.step for p in lanes.simplified_path(lanes.rows[1], most)] == [0, *corner, 10]


@pytest.mark.parametrize(
    ("steps", "existence", "seen_steps", "cameras", "there"),
    [(10, 1.0, 10, 3, True), (10, 0.5, 5, 3, True), (20, 1.3, 20, 1, True), (30, 0.9, 15, 2, True),
     (17, 1.0, 17, 3, True), (18, 1.0, 18, 3, False), (1, 0.0, 1, 1, True)],
)  # fmt: skip
def test_a_short_life_is_nobodys_by_its_length_its_odds_and_its_cameras(
    steps: int, existence: float, seen_steps: int, cameras: int, there: bool
) -> None:
    run = scene(standing((0, steps - 1, 0.0, 0.0)))
    seen = (np.arange(steps)[:, None] < seen_steps) & (np.arange(3) < cameras)
    run.tracks = replace(run.tracks, seen=seen, existences=np.full(steps, existence))
    life = steps / 10.0
    share = seen_steps / steps
    wrong = 0.6 * (1.0 - min(existence, 1.0) * share) * np.exp(-life / 5.0)
    wrong = min(wrong + 0.3 * np.exp(-life) + 0.2 * (cameras == 1), 0.95)
    found = list(single_tracks.items(run, TrackRows(run.tracks)))
    assert [one.kind for one in found] == (["short"] if there else [])
    if there:
        (one,) = found
        assert one.probability == pytest.approx(wrong)
        assert (one.first, one.last, one.tracks, one.stake) == (0, steps - 1, (1,), steps)
        assert [a.probability for a in one.alternatives] == pytest.approx([1.0 - wrong, wrong])
        assert one.why == f"{life:.1f} s long, seen at {100 * share:.0f} % of its steps" + (
            " by one camera alone" if cameras == 1 else ""
        )


def test_who_is_gone_for_more_than_a_second_or_jumps_may_be_two() -> None:
    paths = standing((0, 59, 0.0, 0.0), steps=60)
    paths[40:, 0, 0] = 0.4
    paths[41:, 0, 0] = 0.72  # still the same jump
    paths[50:, 0, 0] = 1.011  # 2.9 m/s
    paths[50:, 0, 1] = 0.0
    run = scene(paths)
    seen = np.ones((60, 3), dtype=bool)
    seen[5:14], seen[20:30] = False, False  # ten steps from box to box, and eleven
    seen[13, 1] = True
    run.tracks = replace(run.tracks, seen=seen)
    gap, fast = single_tracks.moves(run, TrackRows(run.tracks))
    assert (gap.kind, gap.earlier[0].end.step, gap.later[0].begin.step) == ("gap", 19, 30)
    assert gap.log_odds == pytest.approx(log_odds(0.4 * (1.0 - np.exp(-1.1 / 5.0))))
    assert gap.title == "Track 1 is gone for 1.1 s"
    assert gap.why == "no camera has it from step 20 to 29"
    assert (fast.kind, fast.earlier[0].end.step, fast.later[0].begin.step) == ("fast", 39, 40)
    assert fast.log_odds == pytest.approx(log_odds(0.3 * 4.0 / 3.0))
    assert fast.title == "Track 1 jumps: 4.0 m/s at step 40"
    paths[40:, 0, 0] = 2.0
    run = scene(paths)
    (jump,) = single_tracks.moves(run, TrackRows(run.tracks))
    assert jump.log_odds == pytest.approx(log_odds(0.9))


def unclaimed(*places: tuple[int, float]) -> Unclaimed:
    """Step and x of places that two cameras agree about."""
    return Unclaimed(tuple(Place(step, x, 0.0, 0.85) for step, x in places), (0, 2), 0.8)


def test_who_is_missing_is_the_likelier_the_more_cameras_say_so_for_longer() -> None:
    run = scene(standing((0, 99, 0.0, 0.0)))
    brief = track_ends._missing(run, unclaimed(*((k, 0.0) for k in range(10, 22))))
    wrong = 0.8 * 0.8 * (1.0 - np.exp(-1.2))
    assert brief.probability == pytest.approx(wrong)
    assert [one.probability for one in brief.alternatives] == pytest.approx([1.0 - wrong, wrong])
    assert (brief.first, brief.last, brief.stake) == (10, 21, 12)
    assert [place.step for place in brief.places] == [10, 21]
    long = track_ends._missing(run, unclaimed(*((k, 0.0) for k in range(56))))
    assert [place.step for place in long.places] == [0, 14, 28, 41, 55]
    whole = track_ends._missing(run, unclaimed(*((k, 0.0) for k in range(1000))))
    assert len(whole.places) == 12
    names = [camera.name for camera in run.sequence.cameras]
    assert brief.why == f"boxes of {names[0]} and {names[2]} meet for 1.2 s where nobody is tracked"
    three = replace(unclaimed((10, 0.0), (21, 0.0)), cameras=(0, 1, 2))
    told = track_ends._missing(run, three)
    assert told.probability == pytest.approx(0.64 * (1.0 - np.exp(-0.2 * 2)))
    assert f"{names[0]}, {names[1]} and {names[2]}" in told.why


@pytest.mark.parametrize(("first", "last"), [(10, 89), (11, 89), (10, 88), (11, 88)])
def test_who_begins_or_ends_inside_was_there_before_or_after_as_likely_as_cameras_missed(
    first: int, last: int
) -> None:
    """One who walks along x, more than a second from the recording's ends."""
    paths = standing((first, last, 0.0, 0.5))
    paths[:, 0, 0] += 0.01 * (np.arange(100) - 50)
    run = scene(paths)
    run.views = Steps.of([(NO_BOXES,) * 3] * 100, ViewResult, 3)
    lanes = TrackRows(run.tracks)
    found = {one.kind: one for one in track_ends.track_ends(run, lanes, ())}
    assert set(found) == ({"begins"} if first == 11 else set()) | (
        {"ends"} if last == 88 else set()
    )
    for kind, one in found.items():
        step, sign = (first, -1) if kind == "begins" else (last, 1)
        odds = 0.8 / 0.2 * 0.3**3
        assert one.probability == pytest.approx(odds / (1.0 + odds))
        x = 0.01 * (step - 50)
        metres = min(2.2 - abs(x), 1.7)
        assert (one.first, one.stake) == (step, round(10.0 * metres))
        assert f"{metres:.1f} m from where people" in one.why
        (here,) = one.alternatives[1].corrections
        assert here.places[0].step == step + 5 * sign
        assert here.places[0].point == pytest.approx([x + 0.05 * sign, 0.5, 0.85])
        assert one.alternatives[0].corrections[0].places == one.places
        assert {k.kind for k in track_ends.track_ends(run, lanes, one.places)} == set(found) - {
            kind
        }
    run.done = 99
    assert not [k for k in track_ends.track_ends(run, lanes, ()) if k.kind == "ends"]


def test_the_way_out_is_to_the_nearest_side_or_door_and_who_walks_out_is_gone() -> None:
    room = world.volume(2.2, entrances=[(0.3, 0.4, 0.85)])
    run = scene(standing((20, 60, 0.0, 0.0)), room=room)
    for place, metres in (((0.0, 0.0), 0.5), ((-2.0, 0.0), 0.2), ((0.0, -1.9), 0.3),
                          ((2.5, 0.0), 0.0)):  # fmt: skip
        assert track_ends._way_out(run, np.array([*place, 0.85])) == pytest.approx(metres)
    for far, there in ((0.04, True), (0.06, False)):
        paths = standing((20, 60, 2.1, 0.0))
        paths[60, 0, 0] += far
        out = scene(paths, room=room)
        kinds = [one.kind for one in track_ends._edge(out, TrackRows(out.tracks), 1, before=False)]
        assert kinds == (["ends"] if there else [])
    brief = scene(standing((20, 24, 0.0, 0.0)))
    assert not list(track_ends._edge(brief, TrackRows(brief.tracks), 1, before=True))


def test_boxes_of_two_cameras_meet_where_somebody_is_as_high_as_a_person() -> None:
    """And where no track is within a metre."""
    places = world.together(world.stand((0.5, 0.4), 30), world.stand((-1.2, -0.9), 30))
    cameras = world.ring(3)
    seen = world.boxes(cameras, places, 0.0, np.random.default_rng(0))
    run = scene(places[:, 1:])
    for taller, there in ((1.0, True), (1.55, True), (1.65, False), (0.65, True), (0.6, False)):
        high = []
        for camera, one in zip(cameras, seen, strict=True):
            drawn = camera.project_boxes(places[0, one.people], world.PERSON)[0]
            sizes = np.column_stack([one.boxes[:, :3], taller * drawn[:, 3] / 2.0])
            high.append(replace(one, boxes=sizes))
        run.views = Steps.of(world.views(high), ViewResult, 3)
        found = find_unclaimed(run)
        assert len(found) == there, taller
        for one in found:
            assert (one.cameras, one.share) == ((0, 1, 2), 1.0)
            assert [place.step for place in one.places] == list(range(30))
            for place in one.places:
                assert place.point[:2] == pytest.approx(places[0, 0, :2], abs=0.02)
    run.views = Steps.of(world.views(seen), ViewResult, 3)
    for away, count in ((0.99, 0), (1.01, 1)):
        near = run.tracks.positions.copy()
        near[:, :2] = places[0, 0, :2] + [away, 0.0]
        run.tracks = replace(run.tracks, positions=near)
        own = [one for one in find_unclaimed(run) if abs(one.places[0].x - 0.5) < 0.1]
        assert len(own) == count


@pytest.mark.parametrize(
    ("points", "chains"),
    [
        ([(k, 0.0) for k in range(10)], [(0, 9, 1.0)]),
        ([(k, 0.0) for k in range(9)], []),  # less than a second
        ([(k, 0.0) for k in (0, 2, 4, 6, 8, 10, 11, 12)], [(0, 12, 8 / 13)]),
        ([(k, 0.0) for k in (0, 1, 6, 9)], [(0, 9, 0.4)]),  # half a second is no pause
        ([(k, 0.0) for k in (*range(10), *range(15, 25))], [(0, 9, 1.0), (15, 24, 1.0)]),
        ([(k, 0.69 * k) for k in range(10)], [(0, 9, 1.0)]),  # half a metre and two a second
        ([(k, 0.71 * k) for k in range(10)], []),
        ([(k, x) for k in range(12) for x in (0.0, 2.0)], [(0, 11, 1.0), (0, 11, 1.0)]),
        ([(k, x) for k in range(12) for x in (0.0, 0.6)], [(0, 11, 1.0), (0, 11, 1.0)]),
        ([(k, x) for k in range(12) for x in (0.0, 0.2)], [(0, 11, 1.0)]),  # of one step the mean
        (  # the one is waited for while others go on
            sorted([*((k, 0.0) for k in range(10)), *((k, 9.0) for k in range(5, 15))]),
            [(0, 9, 1.0), (5, 14, 1.0)],
        ),
    ],
)
def test_places_in_a_row_are_one_person(
    points: list[tuple[int, float]], chains: list[tuple[int, int, float]]
) -> None:
    rows = np.array([[step, x, 0.0, 0.85, 0, 2] for step, x in points])
    found = list(_chains(rows, 0.1))
    assert [(one.places[0].step, one.places[-1].step, one.share) for one in found] == chains
    assert all(one.cameras == (0, 2) for one in found)
    own = {step: [x for k, x in points if k == step] for step, _ in points}
    assert all(np.ptp([place.x for place in one.places]) == 0.0 for one in found[1:])
    if len(found) == 1:
        for place in found[0].places:
            assert place.x == pytest.approx(np.mean(own[place.step]))


def test_pieces_are_those_of_the_tracks_that_the_smoothed_labels_became() -> None:
    run = scene(standing((0, 19, 0.0, 0.0), (5, 30, 1.0, 0.0)))
    lanes = TrackRows(run.tracks)
    pieces, joined = tracklets_of(run, lanes)
    whole = [Tracklet(k, lanes.of_row(int(rows[0])), lanes.of_row(int(rows[-1])))
             for k, rows in lanes.rows.items()]  # fmt: skip
    assert (pieces, joined) == (whole, None)
    labels, nothing = np.array([8, 4, 6, 8]), np.zeros(0)
    begins, ends = np.arange(12.0).reshape(4, 3), np.arange(12.0, 24.0).reshape(4, 3)
    links = LinkedTracklets(
        labels, np.array([5, 0, 3, 21]), np.array([20, 19, 9, 30]), begins, ends,
        *[np.zeros(4)] * 3, *[np.zeros(0, dtype=np.int64)] * 2, nothing,
    )  # fmt: skip
    tracks = run.tracks
    smoothed = SimpleNamespace(
        joined=links, frames=tracks.frames, means=tracks.positions,
        labels=np.where(tracks.ids == 1, 4, 8),
    )  # fmt: skip
    run.smoothed = cast("Any", smoothed)
    pieces, joined = tracklets_of(run, lanes)
    assert joined is links
    assert pieces == [
        Tracklet(2, Place(5, 0.0, 1.0, 2.0), Place(20, 12.0, 13.0, 14.0)),
        Tracklet(1, Place(0, 3.0, 4.0, 5.0), Place(19, 15.0, 16.0, 17.0)),
        None,  # a label that no track has
        Tracklet(2, Place(21, 9.0, 10.0, 11.0), Place(30, 21.0, 22.0, 23.0)),
    ]
    run.smoothed = cast("Any", SimpleNamespace(**{**vars(smoothed), "means": begins[[0] * 46]}))
    assert tracklets_of(run, lanes) == (whole, None)
