"""What hindsight cut, joined and removed, as the page's events tell it."""

from __future__ import annotations

from dataclasses import replace

from app.web.timeline import Timelines, Window, decided, words_of
from tests.engine.synthetic import crossing, sequence
from tracker.parameters.catalogue import RunParameters
from tracker.review.queue import queue
from tracker.review.queue.item import TrackRows
from tracker.review.queue.links import tracklets_of
from tracker.runs import pipeline
from tracker.smoothing import Decision, names_of

STEPS = 40


def test_a_decision_is_an_event_of_the_track_that_it_happened_to() -> None:
    whole = sequence(crossing(STEPS), STEPS)
    run = pipeline.compute(whole, RunParameters(single_view="none"))
    assert run.smoothed is not None
    names = names_of(run.smoothed, run.tracks)
    assert set(names.values()) == set(run.tracks.ids.tolist())
    assert set(names) <= set(run.smoothed.labels.tolist())
    label = min(names)
    joined = Decision("joined", 7, label, label + 1, 0.97, 0.02, "one person")
    unknown = Decision("removed", 8, 10**6, 10**6, 0.9, 0.1, "nobody")
    run.smoothed = replace(run.smoothed, decisions=(joined, unknown))
    (one,) = decided(run)
    assert (one.step, one.track, one.decision) == (7, names[label], joined)
    other = f" to {one.other}" if one.other is not None else ""
    words = f"joined{other} at 7: one person, 0.97 against 0.02"
    assert words_of(run) == {(7, names[label], "joined"): words}
    told = Timelines().of(whole, run, Window.of(STEPS))
    assert (7, names[label], "joined") in told.events
    assert [(d.step, d.track, d.kind, d.words) for d in told.decisions] == [
        (7, names[label], "joined", words)
    ]


def test_tracks_that_are_not_the_smoothed_ones_yet_have_no_names() -> None:
    # while a run goes on it has stage 3 already, and still the filter's people
    whole = sequence(crossing(STEPS), STEPS)
    run = pipeline.compute(whole, RunParameters(single_view="none"))
    assert run.smoothed is not None
    assert run.smoothed.joined is not None
    assert names_of(run.smoothed, run.tracks)
    run.tracks = run.filtered
    assert names_of(run.smoothed, run.tracks) == {}
    tracklets, joined = tracklets_of(run, TrackRows(run.tracks))
    assert joined is None
    assert {tracklet.track for tracklet in tracklets if tracklet} == set(run.tracks.ids.tolist())
    queue(run)
    # or those of another run, until its own are there
    run.tracks = run.filtered.take(run.filtered.frames < STEPS // 2)
    assert {one.track for one in decided(run)} <= set(run.filtered.ids.tolist())


def test_the_filter_alone_decides_nothing_afterwards() -> None:
    whole = sequence(crossing(STEPS), STEPS)
    run = pipeline.compute(whole, RunParameters(single_view="none", smoothing_method="none"))
    assert decided(run) == []
    assert words_of(run) == {}
