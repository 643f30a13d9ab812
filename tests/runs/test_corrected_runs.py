"""Runs that obey corrections: each kind, in every method, and the same again bit for bit."""

from __future__ import annotations

import itertools
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.conftest import short
from tests.engine.synthetic import crossing, sequence, walk
from tracker.corrections import Correction
from tracker.corrections.kinds import make
from tracker.corrections.log import dump, parse
from tracker.fusion.multi_bernoulli import MultiBernoulli
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.values import with_values
from tracker.review.queue.item import TrackRows
from tracker.runs import pipeline
from tracker.runs.pipeline import Run
from tracker.runs.stage_cache import StageCache
from tracker.sequences.sequence import Sequence

STEPS = 80
FUSIONS = ("multi_bernoulli", "sequential_phd")
SMOOTHINGS = ("identities", "positions", "none")
both = pytest.mark.parametrize(
    ("fusion", "smoothing"),
    [*(("multi_bernoulli", one) for one in SMOOTHINGS), ("sequential_phd", "identities")],
)


def two_walkers() -> Sequence:
    """Two people who cross, seen by three cameras."""
    return sequence(crossing(STEPS), STEPS)


def with_a_gap() -> Sequence:
    """Somebody who is hidden for a while, and somebody else all the time."""
    path = walk((-1.1, 0.5, 1.0), (1.1, 0.6, 1.0), STEPS)
    other = walk((1.1, -0.7, 1.0), (-1.0, -0.6, 1.0), STEPS)
    return sequence([(0, path[:25]), (60, path[60:]), (0, other)], STEPS)


def run_of(
    whole: Sequence,
    told: tuple[Correction, ...] = (),
    fusion: str = "multi_bernoulli",
    smoothing: str = "identities",
    previous: Run | None = None,
    cache: StageCache | None = None,
) -> Run:
    """Boxes as they are, tracked."""
    values = {"fusion_method": fusion, "smoothing_method": smoothing, "fusion.memory": 0.0}
    parameters = with_values(RunParameters(single_view="none"), values)
    return pipeline.compute(whole, parameters, corrections=told, previous=previous, cache=cache)


def place(run: Run, step: int, y: float) -> list[float]:
    """Where the person nearest to y is."""
    rows = np.flatnonzero(run.tracks.frames == step)
    row = rows[np.argmin(np.abs(run.tracks.positions[rows, 1] - y))]
    return [step, *run.tracks.positions[row].tolist()]


def same_tracks(one: Run, other: Run) -> bool:
    """Whether two runs say the same, bit for bit."""
    return all(
        np.array_equal(getattr(one.tracks, name), getattr(other.tracks, name))
        for name in ("frames", "ids", "positions", "existences", "sigmas", "seen")
    )


@pytest.mark.full
@both
def test_who_was_away_is_the_same_person_where_somebody_says_so(
    fusion: str, smoothing: str
) -> None:
    whole = with_a_gap()
    before = run_of(whole, (), fusion, smoothing)
    assert len(set(before.tracks.ids.tolist())) == 3
    said = make(kind="same", places=[place(before, 20, 0.5), place(before, 70, 0.6)])
    after = run_of(whole, (said,), fusion, smoothing)
    assert [one.met for one in after.outcomes] == [True]
    assert len(set(after.tracks.ids.tolist())) == 2
    parted = make(kind="different", places=[place(before, 30, -0.7), place(before, 31, -0.7)])
    both = run_of(whole, (said, parted), fusion, smoothing)
    assert [one.met for one in both.outcomes] == [True, True], both.outcomes
    assert len(set(both.tracks.ids.tolist())) == 3


@pytest.mark.full
@both
def test_somebody_is_where_somebody_says_so(fusion: str, smoothing: str) -> None:
    whole = with_a_gap()
    spot = [45, 0.0, 1.2, 1.0]
    before = run_of(whole, (), fusion, smoothing)
    after = run_of(whole, (make(kind="here", places=[spot], accuracy=0.05),), fusion, smoothing)
    assert [one.met for one in after.outcomes] == [True], after.outcomes
    rows = np.flatnonzero(after.tracks.frames == 45)
    apart = np.linalg.norm(after.tracks.positions[rows] - spot[1:], axis=1)
    assert apart.min() < 0.1
    assert len(rows) == (before.tracks.frames == 45).sum() + 1


@pytest.mark.full
@both
@pytest.mark.parametrize("noise", [0.5, 3.0])
def test_a_track_passes_a_place_to_within_its_accuracy(
    fusion: str, smoothing: str, noise: float
) -> None:
    whole = sequence(crossing(STEPS), STEPS, pixel_noise=noise)
    before = run_of(whole, (), fusion, smoothing)
    x, y, z = place(before, 30, 0.4)[1:]
    for aside, accuracy in itertools.product((0.05, 0.28, 0.8), (0.02, 0.1)):
        said = make(kind="here", places=[[30, x, y + aside, z]], accuracy=accuracy)
        after = run_of(whole, (said,), fusion, smoothing)
        assert [one.met for one in after.outcomes] == [True], after.outcomes
        now = place(after, 30, y + aside)
        assert np.hypot(now[1] - x, now[2] - y - aside) <= accuracy


def test_who_is_said_to_be_elsewhere_stays_himself_and_at_other_steps_where_he_was() -> None:
    whole = two_walkers()
    before = run_of(whole)
    x, y, z = place(before, 30, 0.4)[1:]
    after = run_of(whole, (make(kind="here", places=[[30, x, y + 0.28, z]]),))
    assert np.array_equal(before.tracks.frames, after.tracks.frames)
    assert np.array_equal(before.tracks.ids, after.tracks.ids)
    moved = np.linalg.norm(after.tracks.positions - before.tracks.positions, axis=1)
    sides = before.tracks.positions[:, 1] > 0.0
    assert moved[~sides | (np.abs(before.tracks.frames - 30) > 5)].max() < 0.01
    way = np.diff(after.tracks.positions[(after.tracks.ids == after.outcomes[0].tracks[0])], axis=0)
    speed = np.linalg.norm(way, axis=1) / whole.step_time
    assert speed.max() < 3.0, "as fast as somebody can go"


@pytest.mark.full
@both
def test_who_is_meant_goes_to_the_place_however_far_it_is(fusion: str, smoothing: str) -> None:
    whole = two_walkers()
    before = run_of(whole, (), fusion, smoothing)
    x, y, z = place(before, 30, 0.4)[1:]
    for aside in (0.28, 0.8, 1.0):
        said = make(kind="here", places=[[30, x, y + aside, z], [30, x, y, z]])
        after = run_of(whole, (said,), fusion, smoothing)
        assert [one.met for one in after.outcomes] == [True], after.outcomes
        assert np.array_equal(before.tracks.frames, after.tracks.frames), "nobody else begins"
        assert np.array_equal(before.tracks.ids, after.tracks.ids), "and he stays himself"
        now = place(after, 30, y + aside)
        assert np.hypot(now[1] - x, now[2] - y - aside) <= 0.1
        moved = np.linalg.norm(after.tracks.positions - before.tracks.positions, axis=1)
        sides = before.tracks.positions[:, 1] > 0.0
        assert moved[~sides | (np.abs(before.tracks.frames - 30) > 25)].max() < 0.02


@pytest.mark.full
@pytest.mark.parametrize("fusion", FUSIONS)
def test_a_place_is_a_measurement_of_its_accuracy(fusion: str) -> None:
    whole = two_walkers()
    before = run_of(whole, (), fusion, "none")
    x, y, z = place(before, 30, 0.4)[1:]
    found = []
    for accuracy in (0.01, 0.05, 1.0):
        said = make(kind="here", places=[[30, x, y + 0.05, z]], accuracy=accuracy)
        after = run_of(whole, (said,), fusion, "none")
        found.append(place(after, 30, y + 0.05)[2])
    assert y + 0.05 > found[0] > found[1] > found[2] - 1e-9
    assert found[0] == pytest.approx(y + 0.05, abs=0.02)
    assert found[2] == pytest.approx(y, abs=0.01)


@pytest.mark.full
@both
def test_nobody_is_where_somebody_says_so(fusion: str, smoothing: str) -> None:
    whole = with_a_gap()
    before = run_of(whole, (), fusion, smoothing)
    rows = np.flatnonzero((before.tracks.frames < 30) & (before.tracks.positions[:, 1] > 0.0))
    ends = rows[[0, -1]]
    places = [[int(before.tracks.frames[k]), *before.tracks.positions[k].tolist()] for k in ends]
    after = run_of(whole, (make(kind="nobody", places=places),), fusion, smoothing)
    assert [one.met for one in after.outcomes] == [True]
    left = (after.tracks.frames < 28) & (after.tracks.positions[:, 1] > 0.0)
    assert not left.any()
    others = after.tracks.positions[:, 1] < 0.0
    assert others.sum() >= STEPS - 10, "who is elsewhere stays"


@pytest.mark.full
def test_who_turns_often_is_left_out_along_his_whole_course() -> None:
    steps, turn = 320, 20
    there = walk((-0.5, 0.4, 1.0), (0.5, 0.4, 1.0), turn)
    path = np.concatenate([there if k % 2 else there[::-1] for k in range(steps // turn)])
    other = walk((1.1, -0.9, 1.0), (-1.0, -0.8, 1.0), steps)
    whole = sequence([(0, path), (0, other)], steps)
    before = run_of(whole)
    lanes = TrackRows(before.tracks)
    track = max(
        lanes.ids.tolist(), key=lambda one: before.tracks.positions[lanes.rows[one], 1].mean()
    )
    rows = lanes.rows[track]
    places = lanes.simplified_path(rows, 0.25)
    assert len(places) < len(rows) // 2
    known, x, y = np.array(places)[:, :3].T
    frames, ground = before.tracks.frames[rows], before.tracks.positions[rows, :2]
    way = np.column_stack([np.interp(frames, known, x), np.interp(frames, known, y)])
    assert np.hypot(*(ground - way).T).max() <= 0.25
    after = run_of(whole, (make(kind="nobody", places=places),))
    assert [one.met for one in after.outcomes] == [True]
    assert len(set(after.tracks.ids.tolist())) == 1


@pytest.mark.parametrize("smoothing", short(SMOOTHINGS))
def test_the_log_again_gives_the_same_tracks_bit_for_bit(smoothing: str) -> None:
    whole = with_a_gap()
    before = run_of(whole, (), smoothing=smoothing)
    told = (
        make(kind="same", places=[place(before, 20, 0.5), place(before, 70, 0.6)]),
        make(kind="here", places=[[45, 0.0, 1.2, 1.0]]),
        make(kind="name", places=[place(before, 70, 0.6)], name="Anna"),
    )
    once = run_of(whole, told, smoothing=smoothing)
    again = run_of(whole, parse(dump(told), "log"), smoothing=smoothing)
    assert same_tracks(once, again)
    resumed = run_of(whole, told, smoothing=smoothing, previous=before)
    assert same_tracks(once, resumed)
    back = run_of(whole, (), smoothing=smoothing, previous=once)
    assert same_tracks(before, back)


def test_only_what_depends_on_a_correction_is_computed_again() -> None:
    whole = with_a_gap()
    before = run_of(whole)
    label = run_of(whole, (make(kind="name", places=[place(before, 70, 0.6)], name="A"),))
    here = run_of(whole, (make(kind="here", places=[[45, 0.0, 1.2, 1.0]]),))
    looked = run_of(whole, (make(kind="checked", first=0, last=9),))
    assert label.keys["fusion"] == before.keys["fusion"] != here.keys["fusion"]
    assert here.keys["single_view"] == before.keys["single_view"]
    assert label.keys["smoothing"] != before.keys["smoothing"]
    assert looked.keys == before.keys


GAP = with_a_gap()


@cache
def uncorrected() -> Run:
    """The run of ``GAP`` as it is."""
    return run_of(GAP)


@cache
def choices() -> tuple[Correction, ...]:
    """Corrections of every kind, of ``GAP``."""
    run = uncorrected()
    return (
        make(kind="same", places=[place(run, 20, 0.5), place(run, 70, 0.6)]),
        make(kind="different", places=[place(run, 40, -0.7), place(run, 41, -0.7)]),
        make(kind="different", places=[place(run, 10, 0.5), place(run, 11, 0.5)]),
        make(kind="nobody", places=[place(run, 62, 0.6), place(run, 78, 0.6)]),
        make(kind="left", places=[place(run, 50, -0.7)]),
        make(kind="here", places=[[45, 0.0, 1.2, 1.0]]),
    )


@settings(deadline=None, max_examples=6, suppress_health_check=[HealthCheck.too_slow])
@given(st.lists(st.one_of(st.integers(0, 5), st.just("undo")), min_size=1, max_size=7))
def test_any_sequence_of_corrections_and_undos_ends_where_the_rest_alone_would(
    actions: list[int | str],
) -> None:
    run, told = uncorrected(), []
    for action in actions:
        if isinstance(action, str):
            told = told[:-1]
        elif choices()[action] not in told:
            told = [*told, choices()[action]]
        run = run_of(GAP, tuple(told), previous=run)
    assert same_tracks(run, run_of(GAP, tuple(told)))


_CACHE = StageCache()
"""Of all examples together, so that each finds what others with other corrections left."""


@settings(deadline=None, max_examples=6, suppress_health_check=[HealthCheck.too_slow])
@given(st.lists(st.integers(0, 5), unique=True, max_size=6))
def test_what_other_corrections_left_changes_nothing(chosen: list[int]) -> None:
    told = tuple(choices()[number] for number in chosen)
    once = run_of(GAP, told)
    again = run_of(GAP, told, cache=_CACHE)
    assert same_tracks(once, again)
    assert once.outcomes == again.outcomes
    if told:
        assert once.smoothed is not None
        assert again.smoothed is not None
        assert once.smoothed.decisions == again.smoothed.decisions


def test_a_method_that_takes_no_corrections_runs_as_before(monkeypatch: pytest.MonkeyPatch) -> None:
    class Plain:
        """Of another package: knows nothing of them."""

        def __init__(self, sequence: Sequence, parameters: RunParameters) -> None:
            self._inner = MultiBernoulli(sequence, parameters)
            self.start = self._inner.start

        def step(self, state: Any, views: Any) -> Any:
            """One step."""
            return self._inner.step(state, views)

    monkeypatch.setattr("tracker.runs.pipeline.fusion.create", Plain)
    run = run_of(with_a_gap(), (make(kind="here", places=[[45, 0.0, 1.2, 1.0]]),), smoothing="none")
    assert [one.met for one in run.outcomes] == [False]
    assert len(run.tracks)


@pytest.mark.parametrize("smoothing", short(SMOOTHINGS))
@pytest.mark.parametrize(("kind", "before", "after"), [("left", 50, 51), ("came", 49, 50)])
def test_who_left_or_came_in_while_he_is_seen_on_is_two_people(
    smoothing: str, kind: str, before: int, after: int
) -> None:
    whole = with_a_gap()
    then = run_of(whole, smoothing=smoothing)
    said = make(kind=kind, places=[place(then, 50, -0.7)])
    run = run_of(whole, (said,), smoothing=smoothing, previous=then)
    tracks = run.tracks
    y = tracks.positions[:, 1]
    there = [
        tracks.ids[(tracks.frames == step) & (np.abs(y + 0.7) < 0.4)].tolist()
        for step in (before, after)
    ]
    assert [len(one) for one in there] == [1, 1]
    assert there[0] != there[1]
    assert [one.met for one in run.outcomes] == [True]
