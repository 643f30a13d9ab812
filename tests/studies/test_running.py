"""A study runs, is ended at any moment, goes on, and does nothing twice."""

from __future__ import annotations

import json
import math
import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from tests.studies.processes import wait
from tests.studies.small import Serial, definition, made_up, recording, run
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.values import with_values
from tracker.runs.run import stage_keys
from tracker.studies import space, worker
from tracker.studies.errors import StudyError
from tracker.studies.importance import ImportanceEstimator
from tracker.studies.jobs import Job, Outcome
from tracker.studies.recordings import open_recordings
from tracker.studies.report import report_html
from tracker.studies.sampling import Sampler
from tracker.studies.store import RESULTS, Store, Trial, create
from tracker.studies.summary import summary_of


def near(values: dict[str, Any]) -> float:
    """Best where p_D is .8 and λ_c is 1."""
    p = values.get("fusion.detection_probability", 0.95)
    rate = values.get("fusion.clutter_rate", 3.0)
    return 1.0 - (p - 0.8) ** 2 - 0.05 * math.log(rate) ** 2


def study(folder: Path, **fields: Any) -> Store:
    return create(definition(folder, **fields), folder / "studies")


def test_the_first_trial_is_the_default_and_real_runs_are_scored(tmp_path: Path) -> None:
    store = study(tmp_path, trials=3)
    crew = Serial()
    status = run(store, crew)
    assert status.state == "done"
    trials = store.trials()
    assert [one.number for one in trials] == [0, 1, 2]
    assert trials[0].values == {
        "fusion.detection_probability": 0.95, "fusion.clutter_rate": 3.0,
    }  # fmt: skip
    for one in trials:
        outcome = store.outcome(one.jobs[0].key)
        assert outcome is not None
        figures = outcome.figures
        assert one.objectives == (pytest.approx((figures["hota"] + figures["idf1"]) / 2.0),)
        assert len(outcome.tracks) == 24
        assert figures["speed"] > 0.0


TIMED = """
import sys
from pathlib import Path
from tests.studies.small import Serial, run
from tracker.kernels import compilation
from tracker.studies import worker
from tracker.studies.store import Store

compute = worker.pipeline.compute

def counted(*arguments, **named):
    before = compilation.counts()[0]
    found = compute(*arguments, **named)
    print("timed" if "steps" not in named else "first", compilation.counts()[0] - before)
    return found

worker.pipeline.compute = counted
run(Store(Path(sys.argv[1])), Serial())
"""


def test_the_first_speed_is_not_that_of_loading_kernels(tmp_path: Path) -> None:
    store = study(
        tmp_path, trials=4, objectives=["speed"], prune=False, search="grid",
        parameters={"fusion_method": {}, "fusion.update": {}},
    )  # fmt: skip
    done = subprocess.run(
        [sys.executable, "-c", TIMED, str(store.folder)],
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert done.returncode == 0, done.stderr
    loaded = [(how, int(count)) for how, count in map(str.split, done.stdout.splitlines())]
    assert ("timed", 0) in loaded
    assert {count for how, count in loaded if how == "timed"} == {0}
    assert sum(count for how, count in loaded if how == "first") > 0


def test_a_search_finds_what_is_better(tmp_path: Path) -> None:
    store = study(tmp_path, trials=60, prune=False)
    run(store, Serial(made_up(near)))
    summary = summary_of(store)
    assert summary.best is not None
    assert summary.best.objectives[0] > near({}) + 0.02
    assert summary.best.values["fusion.detection_probability"] == pytest.approx(0.8, abs=0.08)
    assert {key for key, _ in summary.importance} == set(summary.defaults)
    assert all(0.0 <= share <= 1.0 and spread >= 0.0 for _, (share, spread) in summary.importance)


def test_who_looks_again_reads_only_what_is_new(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = study(tmp_path, trials=8, prune=False)
    crew = Serial(made_up(near), stop_after=5)
    with pytest.raises(KeyboardInterrupt):
        run(store, crew)
    before = summary_of(store)
    assert 0 < len(before.trials) < 8
    run(store, Serial(made_up(near)))
    asked = []
    trials = Store.trials
    monkeypatch.setattr(
        Store, "trials", lambda self, after=0.0: asked.append(after) or trials(self, after)
    )
    now = summary_of(store, before)
    assert asked == [max(one.ended for one in before.trials)]
    fresh = summary_of(store)
    assert now.trials == fresh.trials
    assert (now.best, now.front) == (fresh.best, fresh.front)
    again = summary_of(store, now)
    assert again.trials == fresh.trials
    assert again.front == fresh.front


@pytest.mark.parametrize("after", [0, 3, 10])
def test_a_study_that_is_ended_goes_on_and_does_nothing_twice(tmp_path: Path, after: int) -> None:
    recording(tmp_path / "other")
    fields = {"trials": 6, "seeds": 2, "recordings": ["recording", "other"], "prune": False}
    whole = study(tmp_path, name="whole", **fields)
    run(whole, Serial(made_up(near)))
    store = study(tmp_path, name="ended", **fields)
    first = Serial(made_up(near), stop_after=after)
    with pytest.raises(KeyboardInterrupt):
        run(store, first)
    assert store.status().state == "stopped"
    ended = store.trials()
    second = Serial(made_up(near))
    run(store, second)
    assert not set(first.done) & set(second.done)
    assert store.trials()[: len(ended)] == ended
    assert len(store.trials()) == 6
    assert len(first.done) + len(second.done) == len(set(first.done) | set(second.done))
    status = store.status()
    assert status.runs == len(second.done)
    assert status.all_runs == len(first.done) + len(second.done)
    assert status.all_seconds > status.seconds
    # until it was ended it asked for what the other did
    same = [one.values for one in store.trials()[: max(1, len(ended))]]
    assert same == [one.values for one in whole.trials()[: len(same)]]


def test_the_same_values_are_run_once(tmp_path: Path) -> None:
    choices = {"smoothing_method": {"choices": ["none", "positions"]}}
    store = study(tmp_path, trials=9, parameters=choices, prune=False, search="random")
    crew = Serial(made_up(lambda values: 0.5))
    run(store, crew)
    assert len(store.trials()) == 9
    assert len(crew.done) == len(set(crew.done)) <= 3


def test_a_grid_tries_all_and_no_more(tmp_path: Path) -> None:
    parameters = {
        "fusion.clutter_rate": {"low": 1, "high": 9, "steps": 3},
        "smoothing_method": {"choices": ["none", "positions"]},
    }
    store = study(tmp_path, trials=20, parameters=parameters, search="grid", prune=False)
    run(store, Serial(made_up(near)))
    tried = [tuple(sorted(one.values.items())) for one in store.trials()]
    assert len(tried) == 7  # the defaults, then the grid
    assert len(set(tried[1:])) == 6
    small = study(tmp_path, name="small grid", trials=5, parameters=parameters, search="grid")
    with pytest.raises(StudyError, match="more combinations than the 5 trials"):
        run(small, Serial(made_up(near)))


def test_hopeless_trials_are_given_up_after_their_first_runs(tmp_path: Path) -> None:
    store = study(tmp_path, trials=40, seeds=6, search="random")
    crew = Serial(made_up(near))
    run(store, crew)
    trials = store.trials()
    pruned = [one for one in trials if one.state == "pruned"]
    assert pruned
    assert all(len(one.jobs) == 2 for one in pruned)
    complete = sorted(one.objectives[0] for one in trials if one.state == "complete")
    best = max(near(one.values) for one in trials)
    assert complete[-1] == pytest.approx(best)
    assert len(crew.done) < 40 * 6


def test_several_objectives_have_a_front(tmp_path: Path) -> None:
    def do(job: Job) -> Outcome:
        p = dict(job.values).get("fusion.detection_probability", 0.95)
        figures = {"score": p, "speed": 100.0 * (1.0 - p)}
        return Outcome(job.key, "done", figures=figures, seconds=0.01)

    store = study(tmp_path, trials=12, objectives=["score", "speed"])
    run(store, Serial(do))
    summary = summary_of(store)
    assert len(summary.front) == 12
    assert summary.best.number == max(summary.trials, key=lambda t: t.objectives[0]).number


def test_a_trial_that_fails_keeps_no_other_up(tmp_path: Path) -> None:
    def do(job: Job) -> Outcome:
        if dict(job.values).get("fusion.clutter_rate", 3.0) < 1.0:
            return Outcome(job.key, "failed", "it was too quiet")
        return made_up(near)(job)

    store = study(tmp_path, trials=20, search="random")
    run(store, Serial(do))
    failed = [one for one in store.trials() if one.state == "failed"]
    assert failed
    assert all(one.words == "it was too quiet" and one.objectives is None for one in failed)
    assert len(store.trials()) == 20


def test_defaults_that_fail_end_the_study(tmp_path: Path) -> None:
    store = study(tmp_path)
    with pytest.raises(StudyError, match=r"the defaults cannot be run, .*: no way"):
        run(store, Serial(lambda job: Outcome(job.key, "failed", "no way")))
    assert store.status().state == "failed"
    assert "no way" in store.status().words


def test_people_who_leave_the_pictures_are_vetoed(tmp_path: Path) -> None:
    recording(tmp_path / "blind", truth=False)

    def do(job: Job) -> Outcome:
        p = dict(job.values).get("fusion.detection_probability", 0.95)
        overlap = 0.6 if p > 0.8 else 0.2  # agreement alone would choose the lowest
        return Outcome(job.key, "done", figures={"identity": 1.0 - p}, overlap=overlap)

    store = study(tmp_path, trials=30, recordings=["blind"], objectives=[], prune=False)
    run(store, Serial(do))
    summary = summary_of(store)
    assert [one.key for one in summary.objectives] == ["identity"]
    assert any(one.vetoed for one in summary.trials)
    assert all(one.vetoed == (one.values["fusion.detection_probability"] <= 0.8)
               for one in summary.trials)  # fmt: skip
    assert summary.best.values["fusion.detection_probability"] > 0.8
    assert any("no truth was looked at" in one for one in summary.sentences())
    assert [one.key for one in summary.beside] == ["held_out"]
    for one in summary.trials:
        assert one.figures["held_out"] == (0.2 if one.vetoed else 0.6)
    assert '<th scope="col">Held-out camera</th>' in report_html(store)


def test_a_study_of_before_the_camera_left_out_was_kept_opens_and_goes_on(tmp_path: Path) -> None:
    recording(tmp_path / "blind", truth=False)
    store = study(tmp_path, trials=4, recordings=["blind"], objectives=[], prune=False)
    with pytest.raises(KeyboardInterrupt):
        run(store, Serial(made_up(near), stop_after=2))
    with sqlite3.connect(store.folder / RESULTS) as results:
        ended = "SELECT number, told FROM trials WHERE state != 'running'"
        for number, told in results.execute(ended).fetchall():
            trial = json.loads(told)
            del trial["figures"]["held_out"]
            results.execute(
                "UPDATE trials SET told = ? WHERE number = ?", (json.dumps(trial), number)
            )
    results.close()
    assert len(summary_of(store).trials) == 2
    assert "held_out" not in [one.key for one in summary_of(store).beside]
    assert "Held-out camera" not in report_html(store)
    run(store, Serial(made_up(near)))
    known = ["held_out" in one.figures for one in store.trials()]
    assert known == [False, False, True, True]
    assert "held_out" in [one.key for one in summary_of(store).beside]
    assert "<td>–</td>" in report_html(store)


def test_what_needs_a_truth_is_told_where_there_is_none(tmp_path: Path) -> None:
    recording(tmp_path / "blind", truth=False)
    store = study(tmp_path, recordings=["blind"], objectives=["idf1"])
    with pytest.raises(StudyError, match="idf1 needs a truth, and numbers has none; take identity"):
        run(store, Serial())


@pytest.mark.full
def test_two_studies_of_one_name_are_told(tmp_path: Path) -> None:
    store = study(tmp_path)
    assert study(tmp_path).folder == store.folder
    with pytest.raises(StudyError, match='there is another study "small"'):
        study(tmp_path, trials=7)
    with store.running():
        assert store.is_running()
        with pytest.raises(StudyError, match="is run by another process"), store.running():
            pass
    assert not store.is_running()


def test_a_recording_that_changed_since_is_told(tmp_path: Path) -> None:
    store = study(tmp_path, trials=2)
    run(store, Serial(made_up(near)))
    boxes = tmp_path / "recording" / "cam1.csv"
    boxes.write_text(boxes.read_text(encoding="utf-8").replace("20.5", "21.5"), encoding="utf-8")
    with pytest.raises(StudyError, match="has changed since the study small began"):
        run(store, Serial(made_up(near)))


@pytest.mark.full
def test_the_time_ends_it(tmp_path: Path) -> None:
    store = study(tmp_path, trials=10_000, minutes=0.01)
    status = run(store, Serial(made_up(near)))
    assert status.state == "done"
    assert "minutes are over" in status.words
    assert 0 < len(store.trials()) < 10_000


def test_a_trial_that_ended_before_the_sampler_heard_of_it_stays_as_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = study(tmp_path, trials=6, seeds=2)
    tell = Sampler.tell

    def killed(self: Sampler, trial: Trial) -> None:
        if trial.number == 2:
            raise KeyboardInterrupt
        tell(self, trial)

    monkeypatch.setattr(Sampler, "tell", killed)
    with pytest.raises(KeyboardInterrupt):
        run(store, Serial(made_up(near)))
    monkeypatch.setattr(Sampler, "tell", tell)
    before = store.trials()
    assert [one.number for one in before] == [0, 1, 2]
    run(store, Serial(made_up(near)))
    assert store.trials()[:3] == before
    assert len(store.trials()) == 6


def test_trials_under_way_are_tried_again_with_their_values(tmp_path: Path) -> None:
    store = study(tmp_path, trials=6, seeds=4)
    with pytest.raises(KeyboardInterrupt):
        run(store, Serial(made_up(near), stop_after=10))
    before = store.running_trials()
    assert before
    run(store, Serial(made_up(near)))
    assert store.running_trials() == {}
    assert {number: store.trial(number).values for number in before} == before


def test_a_worker_keeps_stage_1_and_little_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(worker, "_process", None)
    monkeypatch.setattr(worker, "LATER_BYTES", 120_000)
    every = open_recordings(definition(tmp_path))
    kept = []
    for number in range(24):
        values = {"fusion.detection_probability": 0.7 + 0.01 * number}
        ((_, job),) = every.jobs(values)
        assert worker.work(job).became == "done"
        assert worker._process is not None
        kept.append(worker._process.cache.used_bytes)
    assert kept[0] < kept[1], "later stages are kept at all"
    assert max(kept) < kept[0] + 120_000 < 24 * (kept[1] - kept[0])
    one = every.every[0]
    parameters = with_values(one.base, {"fusion.detection_probability": 0.5})
    key = stage_keys(one.sequence, parameters, job.seed)["single_view"]
    cache = worker._process.cache
    assert cache.views(key, frames=one.sequence.frames, cameras=3) is not None


def test_what_matters_is_told_by_all_trials_at_the_end_and_not_twice(tmp_path: Path) -> None:
    store = study(tmp_path, trials=31, prune=False)
    run(store, Serial(made_up(near)))
    assert store.fact("importance")["trials"] == 31
    with closing(sqlite3.connect(store.folder / RESULTS, isolation_level=None)) as results:
        known = json.dumps({"trials": 31, "shares": {}})
        results.execute("UPDATE told SET value = ? WHERE name = 'importance'", (known,))
    run(store, Serial(made_up(near)))
    assert store.fact("importance")["shares"] == {}


def test_what_matters_is_told_again_when_trials_have_doubled_and_at_the_end(
    tmp_path: Path,
) -> None:
    varied = definition(tmp_path).varied
    trials = []
    for number in range(48):
        share = (7 * number % 48) / 48.0
        values = {one.key: one.low + share * (one.high - one.low) for one in varied}
        trials.append(Trial(number, "complete", values, (share,), (None,), {}, False, "", 0.1, ()))
    with closing(ImportanceEstimator(varied, space.defaults_of(varied, RunParameters()))) as own:

        def until_found(number: int) -> int:
            return int(wait(lambda: own.update(trials[:number]))["trials"])

        assert [own.update(trials[:number]) for number in (1, 11)] == [None, None]
        assert until_found(13) == 13
        assert [own.update(trials[:number]) for number in (13, 25)] == [None, None]
        assert until_found(26) == 26
        assert own.update(trials, last=True)["trials"] == 48
        assert own.update(trials, last=True) is None
