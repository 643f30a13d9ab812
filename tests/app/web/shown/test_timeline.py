"""The timeline at any zoom: a bounded number of values that hide nothing and invent nothing."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from starlette.testclient import TestClient

from app.state.scores import Scored
from app.web.timeline import MOST_TRACKS, Timelines, Window, counts, numbers
from tests.app.folders import FRAMES
from tests.engine.synthetic import crossing, sequence
from tracker.fusion.trajectories import Trajectories
from tracker.parameters.catalogue import RunParameters
from tracker.runs import pipeline
from tracker.runs.pipeline import Run
from tracker.sequences.sequence import Template


def run_of(frames: int, rows: list[tuple[int, int, bool]]) -> Run:
    """A finished run that reports these targets: step, id, seen."""
    whole = sequence(crossing(2), 2)
    run = Run(whole, RunParameters(), 0, {"tracks": "key"})  # type: ignore[typeddict-item]
    rows = sorted(rows)
    count = len(rows)
    run.tracks = Trajectories(
        frames=np.array([row[0] for row in rows], dtype=np.int64),
        ids=np.array([row[1] for row in rows], dtype=np.int64),
        positions=np.zeros((count, 3)),
        existences=np.ones(count),
        sigmas=np.ones((count, 3)),
        seen=np.array([[row[2], False, False] for row in rows], dtype=bool).reshape(count, 3),
        components=np.zeros(count, dtype=np.int64),
        labels=np.zeros(count, dtype=np.int64),
        covariances_xy=np.zeros(count),
        heights=np.full(count, np.nan),
        sigma_heights=np.full(count, np.nan),
    )
    run.done = frames
    return run


@given(
    st.integers(1, 400),
    st.integers(0, 450),
    st.one_of(st.none(), st.integers(0, 450)),
    st.integers(1, 60),
    st.integers(0, 2**32 - 1),
)
def test_the_buckets_hold_every_step_once(
    frames: int, first: int, last: int | None, buckets: int, seed: int
) -> None:
    window = Window.of(frames, first, last, buckets)
    values = np.random.default_rng(seed).integers(0, 9, frames)
    summary = counts(values, window)
    starts = window.starts(frames)
    assert len(summary.low) == len(summary.high) == len(summary.mean) == len(starts) <= buckets
    assert all(start % window.stride == 0 for start in starts)
    shown = range(min(first, frames), frames if last is None else min(last + 1, frames))
    assert set(shown) <= set(range(window.first, window.end))
    worst = window.worst(values)
    for k, start in enumerate(starts.tolist()):
        part = values[start : min(start + window.stride, window.end)]
        assert (summary.low[k], summary.high[k]) == (part.min(), part.max())
        assert summary.mean[k] == pytest.approx(part.mean(), abs=1e-3)
        assert values[worst[k]] == part.max()
        assert start <= worst[k] < start + window.stride


def test_nothing_gives_nothing() -> None:
    window = Window.of(100)
    assert counts(np.zeros(0, dtype=np.int64), window).low == []
    assert numbers(np.zeros(0), window).mean == []
    assert len(window.worst(np.zeros(0))) == 0
    assert numbers(np.array([np.nan, 1.0]), Window.of(2)).high[1] == 1.0
    assert Window.of(4, buckets=1).worst(np.array([1.0, np.nan, 3.0, 2.0])).tolist() == [2]
    assert Window.of(2, buckets=1).worst(np.array([np.nan, np.nan])).tolist() == [0]


def test_a_lane_keeps_what_is_long_enough_to_be_seen() -> None:
    flicker = [(k, 1, k % 2 == 0) for k in range(100)]
    missed = [(k, 1, False) for k in range(100, 200)]
    again = [(k, 1, True) for k in range(200, 300)]
    gone_and_back = [(k, 1, True) for k in range(400, 500)]
    run = run_of(500, flicker + missed + again + gone_and_back)
    whole = Timelines().of(run.sequence, run, Window.of(500))
    assert len(whole.tracks[0].spans) == 99 + 3, (
        "the last miss of the flicker belongs to the long one"
    )
    coarse = Timelines().of(run.sequence, run, Window.of(500, buckets=25))
    assert (coarse.stride, coarse.tracks[0].seen) == (20, 250 / 500)
    kinds = [kind for _, _, kind in coarse.tracks[0].spans]
    assert kinds[-3:] == ["long miss", "seen", "seen"]
    spans = coarse.tracks[0].spans
    assert len(spans) <= 25
    assert spans[-1][0] - spans[-2][1] > 1, "a long absence stays one"
    assert spans[0][0] == 0
    assert spans[-1][1] == 499


@given(st.lists(st.tuples(st.integers(0, 199), st.integers(1, 6), st.booleans()), max_size=300))
def test_spans_stay_in_the_window_and_do_not_overlap(rows: list[tuple[int, int, bool]]) -> None:
    unique = {(step, track): seen for step, track, seen in rows}
    run = run_of(200, [(step, track, seen) for (step, track), seen in unique.items()])
    for window in (Window.of(200), Window.of(200, 30, 149, 7), Window.of(200, 30, 149, 1000)):
        told = Timelines().of(run.sequence, run, window)
        for track in told.tracks:
            steps = [step for step, name in unique if name == track.id]
            assert (track.first, track.last) == (min(steps), max(steps))
            assert track.cameras == [track.seen, 0.0, 0.0]
            before = window.first - 1
            for first, last, _ in track.spans:
                assert before < first <= last < window.end
                before = last
            assert len(track.spans) <= len(window.starts(200))
        assert [track.id for track in told.tracks] == sorted(
            {
                name
                for name in {name for _, name in unique}
                if min(s for s, n in unique if n == name) < window.end
                and max(s for s, n in unique if n == name) >= window.first
            }
        )


def test_of_very_many_tracks_the_longest_are_told() -> None:
    count = MOST_TRACKS + 50
    rows = [(k, 1 + k, True) for k in range(count)] + [(k + 1, 1 + k, True) for k in range(0, 90)]
    run = run_of(count + 1, rows)
    told = Timelines().of(run.sequence, run, Window.of(count + 1))
    assert (len(told.tracks), told.left_out) == (MOST_TRACKS, 50)
    assert [track.id for track in told.tracks] == list(range(1, MOST_TRACKS + 1))


def test_a_growing_run_is_counted_on() -> None:
    whole = sequence(crossing(40), 40)
    run = pipeline.compute(whole, RunParameters(single_view="none"))
    timelines, window = Timelines(), Window.of(40)
    run.done = 15
    before = timelines.of(whole, run, window)
    run.done = 40
    after = timelines.of(whole, run, window)
    assert (before.done, after.done) == (15, 40)
    for name in ("count", "cardinality"):
        assert len(getattr(before, name).low) == 15
        assert getattr(after, name).low[:15] == getattr(before, name).low
    assert max(track.last for track in before.tracks) <= 14
    assert after == Timelines().of(whole, run, window)


def test_names_are_those_of_the_run_while_its_templates_are_renamed() -> None:
    frames, people = 40, ("Ann", "Bob", "Cleo")
    boxes = [Template(name, "cam0", 0, np.array([0.0, 0.0, 9.0, 20.0])) for name in people]
    taught = replace(sequence(crossing(frames), frames), templates=tuple(boxes))
    run = pipeline.compute(taught, RunParameters(single_view="none"))
    like_the_third = [
        tuple(
            replace(view, likenesses=np.tile([0.1, 0.1, 0.8], (len(view.boxes), 1)))
            for view in views
        )
        for views in run.views
    ]
    run.views = run.views.alike(like_the_third)
    one_name = tuple(replace(template, name="Dan") for template in boxes[:2])
    renamed = replace(taught, templates=(*one_name, replace(boxes[2], name="Eve")))
    timelines, window = Timelines(), Window.of(frames)
    smoothed, run.tracks = run.tracks, run.filtered
    for open_ in (taught, renamed, replace(renamed, templates=()), taught):
        told = timelines.of(open_, run, window)
        assert {track.name for track in told.tracks} == {"Cleo"}
    # its tracks are replaced: an id may be another person's by now
    run.tracks = smoothed.take(smoothed.frames >= frames // 2)
    run.tracks = replace(run.tracks, ids=run.tracks.ids + 100)
    assert {track.name for track in timelines.of(renamed, run, window).tracks} == {"Cleo"}
    assert timelines.of(renamed, run, window) == Timelines().of(renamed, run, window)
    assert set(timelines._names.by_track(run)) == set(run.tracks.ids.tolist())


@pytest.mark.full
def test_what_a_page_gets_does_not_grow_with_the_recording() -> None:
    sizes = []
    for frames in (2_000, 20_000):
        rng = np.random.default_rng(1)
        rows = [(k, n, bool(rng.random() < 0.8)) for k in range(frames) for n in range(1, 5)]
        run = run_of(frames, rows)
        told = Timelines().of(run.sequence, run, Window.of(frames, buckets=512))
        sizes.append(len(told.model_dump_json()))
    assert sizes[1] < 1.2 * sizes[0]


@pytest.mark.full
def test_the_routes_take_a_part_and_a_width(client: TestClient) -> None:
    whole = client.get("/api/timeline").json()
    part = client.get("/api/timeline?first=20&last=59&buckets=10").json()
    assert (part["first"], part["stride"], part["frames"]) == (20, 4, FRAMES)
    assert len(part["count"]["mean"]) == 10
    assert part["count"]["high"][0] == max(whole["count"]["high"][20:24])
    series = client.get("/api/evaluation/series").json()
    coarse = client.get("/api/evaluation/series?first=20&last=59&buckets=10").json()
    assert (coarse["first"], coarse["stride"], len(coarse["gospa"])) == (20, 4, 10)
    for k in range(10):
        steps = slice(20 + 4 * k, 24 + 4 * k)
        assert coarse["ospa"][k] == max(series["ospa"][steps])
        assert coarse["gospa"][k] == max(series["gospa"][steps])
        at = 20 + 4 * k + int(np.argmax(series["gospa"][steps]))
        assert coarse["gospa_missed"][k] == series["gospa_missed"][at]
    for fine, other in zip(series["track_errors"], coarse["track_errors"], strict=True):
        values = dict(enumerate(fine["values"], fine["first"]))
        for k, value in enumerate(other["values"]):
            first = other["first"] + 4 * k
            known = [v for s in range(first, first + 4) if (v := values.get(s)) is not None]
            assert value == (max(known) if known else None)
    beyond = client.get("/api/timeline?first=5000&last=9000").json()
    assert (beyond["count"]["low"], beyond["tracks"]) == ([], [])
    for wrong in ("first=-1", "buckets=0", "buckets=x"):
        assert client.get(f"/api/timeline?{wrong}").status_code == 422
    json.dumps(part, allow_nan=False)


def test_events_are_those_of_the_whole_recording_whatever_is_looked_at() -> None:
    seen = [(k, 1, True) for k in range(20)] + [(k, 2, True) for k in range(5, 200)]
    miss = [(k, 3, not 60 <= k < 140) for k in range(30, 160)]
    short = [(k, 4, k not in (100, 101)) for k in range(0, 200)]
    run = run_of(200, seen + miss + short)
    assert run.sequence.fps * 1.5 < 80
    told = Timelines().of(run.sequence, run, Window.of(200)).events
    assert told == [
        (5, 2, "birth"),
        (19, 1, "death"),
        (30, 3, "birth"),
        (60, 3, "long miss"),
        (159, 3, "death"),
    ]
    part = Timelines().of(run.sequence, run, Window.of(200, 100, 120))
    assert part.events == told
    lane = next(track for track in part.tracks if track.id == 3)
    assert lane.spans == [(100, 120, "long miss")], "a part of it is one too"
    whole = Timelines().of(run.sequence, run, Window.of(200))
    kinds = [kind for _, _, kind in next(t for t in whole.tracks if t.id == 3).spans]
    assert kinds == ["seen", "long miss", "seen"]


def test_the_pinned_run_beside_the_shown_one() -> None:
    whole = sequence(crossing(120), 120)
    run = pipeline.compute(whole, RunParameters(single_view="none"))
    other = pipeline.compute(whole, RunParameters(single_view="none"), seed=1)
    swapped = run.tracks.take(run.tracks.ids <= 2)
    swapped = replace(swapped, ids=3 - swapped.ids)
    other.tracks, other.keys = swapped, {**other.keys, "tracks": "another"}
    window = Window.of(120)
    assert Timelines().of(whole, run, window).pinned is None
    assert Timelines().of(whole, run, window, Scored.of(run)).pinned is None
    told = Timelines().of(whole, run, window, Scored.of(other)).pinned
    assert told is not None
    assert {track.id: track.like for track in told.tracks} == {1: 2, 2: 1}
    both = np.bincount(swapped.frames, minlength=120)
    assert told.count.low == both.tolist()
    far = replace(swapped, positions=swapped.positions + 50.0)
    other.tracks, other.keys = far, {**other.keys, "tracks": "a third"}
    told = Timelines().of(whole, run, window, Scored.of(other)).pinned
    assert told is not None
    assert [track.like for track in told.tracks] == [None, None]
