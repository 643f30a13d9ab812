"""The shown run against the truth: routes, messages, pinning, and the worker behind them."""

from __future__ import annotations

import contextlib
import html
import json
import re
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

import numpy as np
import pytest
from starlette.testclient import TestClient

from app.state import evaluator as worker
from app.state.evaluator import Evaluator
from app.state.scores import Scored, Scores
from app.state.workbench import Workbench
from app.web.dependencies import Settings
from app.web.evaluation import axis_end, comparison_of
from app.web.server import create_app
from tests.app.conftest import ADDRESS, command, connect, is_evaluated, run_is, wait_until
from tests.app.folders import FRAMES
from tracker.evaluation import DEFINITIONS, compare, evaluate_sequence
from tracker.parameters.values import with_values
from tracker.runs import pipeline
from tracker.runs.pipeline import Progress, Run
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.reader import read_sequence
from tracker.sequences.sequence import Sequence

P_D = "fusion.detection_probability"


def engine(folder: Path, **changes: Any) -> Run:
    sequence = read_sequence(folder)
    wanted = with_values(pipeline.default_parameters(sequence), changes)
    return pipeline.compute(sequence, wanted)


def change(client: TestClient, **changes: Any) -> None:
    command(client, "set_parameters", changes=changes)
    wait_until(run_is(client, "done"))
    wait_until(is_evaluated(client))


def get(client: TestClient, path: str) -> Any:
    answer = client.get(path)
    assert answer.status_code == 200, answer.text
    return answer.json()


def test_figures_are_the_engines(client: TestClient, crossing: Path) -> None:
    run = engine(crossing)
    expected = evaluate_sequence(run.sequence, run.tracks)
    found = get(client, "/api/evaluation")
    assert (found["run"], found["steps"], found["partial"]) == (run.key, FRAMES, False)
    assert found["settings"]["gate"] == 1.0
    assert [f["name"] for f in found["figures"]] == [d.key for d in DEFINITIONS]
    for shown, figure in zip(found["figures"], expected.figures, strict=True):
        assert shown["value"] == figure.value
        assert shown["settings"] == figure.measured_with
        assert shown["label"]
        assert shown["help"].endswith(".")
    people = {row["id"]: row["mean_error"] for row in found["per_person"]}
    assert people == {row.id: row.error for row in expected.people}
    tracks = {row["id"]: (row["mean_error"], row["matched"]) for row in found["per_track"]}
    assert tracks == {row.id: (row.error, row.matched) for row in expected.tracks}
    assert sum(row["switches"] for row in found["per_track"]) == expected["id_switches"]
    assert [row["camera"] for row in found["cameras"]] == ["left", "right", "back"]


@pytest.mark.full
def test_series_are_the_engines(client: TestClient, crossing: Path) -> None:
    run = engine(crossing)
    expected = evaluate_sequence(run.sequence, run.tracks)
    found = get(client, "/api/evaluation/series")
    assert (found["run"], found["of"]) == (run.key, "shown")
    assert found["cost"] == "cut-off 1 m, order 1"
    for name in ("ospa", "ospa_localisation", "ospa_cardinality", "gospa", "truth", "estimates"):
        np.testing.assert_allclose(found[name], getattr(expected.series, name), atol=6e-5)
    assert len(found["errors"]) == 2
    for row in found["errors"]:
        values = np.full(FRAMES, np.nan)
        values[row["first"] : row["first"] + len(row["values"])] = np.array(row["values"], float)
        np.testing.assert_allclose(values, expected.errors[row["person"]], atol=6e-5)
    total = expected.series.ospa_localisation + expected.series.ospa_cardinality
    share = np.where(total > 0, expected.series.ospa_localisation / np.maximum(total, 1e-12), 0)
    np.testing.assert_allclose(found["ospa_share"], share, atol=6e-4)
    assert all(0.0 <= value <= 1.0 for value in found["gospa_share"])
    sums, counts = np.zeros(FRAMES), np.zeros(FRAMES)
    for row in found["track_errors"]:
        for k, value in enumerate(row["values"], row["first"]):
            if value is not None:
                sums[k] += value
                counts[k] += 1
    mean = [None if not count else total / count for total, count in zip(sums, counts, strict=True)]
    for value, wanted in zip(found["mean_error"], mean, strict=True):
        assert value == (None if wanted is None else pytest.approx(wanted, abs=2e-4))
    pairs = sum(v is not None for row in found["track_errors"] for v in row["values"])
    assert pairs == len(expected.pairs.steps)
    assert len(found["switches"]) == expected["id_switches"]
    for switch in found["switches"]:
        assert switch["before"] != switch["track"]


def test_an_axis_ends_at_a_round_number_above_nearly_all() -> None:
    rng = np.random.default_rng(4)
    for scale in (0.01, 0.3, 1.0, 7.0, 60.0):
        values = rng.uniform(0.0, scale, 500)
        end = axis_end(values)
        assert float(f"{end:.0e}") == end
        assert f"{end:.0e}"[0] in "125"
        assert (values > end).mean() <= 0.02
        assert end == 0.1 or end < 2.6 * np.sort(values)[489]
    assert axis_end(np.zeros(0)) == axis_end(np.array([np.nan])) == 0.1


@pytest.mark.full
def test_a_run_is_set_against_the_one_before_it(client: TestClient, crossing: Path) -> None:
    assert client.get("/api/evaluation/comparison").json() is None
    assert client.get("/api/evaluation/series?of=previous").status_code == 409
    assert get(client, "/api/evaluation/curves")["reference"] is None
    change(client, **{P_D: 0.05})
    found = get(client, "/api/evaluation/comparison")
    before, after = engine(crossing), engine(crossing, **{P_D: 0.05})
    a, b = (evaluate_sequence(run.sequence, run.tracks) for run in (before, after))
    assert (found["against"], found["steps"]) == ("previous", FRAMES)
    assert (found["a"]["run"], found["b"]["run"]) == (before.key, after.key)
    assert found["b"]["changed"] == {P_D: 0.05}
    assert [row["key"] for row in found["parameters"]] == [P_D]
    rows = [(row["name"], row["a"], row["b"], row["verdict"]) for row in found["rows"]]
    assert rows == [(row.definition.key, row.a, row.b, row.verdict) for row in compare(a, b)]
    assert {"better", "worse"} & {row[3] for row in rows}
    series = get(client, "/api/evaluation/series?of=previous")
    assert (series["run"], series["of"]) == (before.key, "previous")
    assert get(client, "/api/evaluation/curves") == {
        "evaluation": get(client, "/api/evaluation"),
        "series": get(client, "/api/evaluation/series"),
        "reference": series,
    }


@pytest.mark.full
def test_a_pinned_run_stays_the_reference(client: TestClient) -> None:
    assert get(client, "/api/state")["pinned"] is None
    pinned = client.post("/api/run/pin").json()["pinned"]
    first = get(client, "/api/state")["run"]["key"]
    assert pinned["key"] == first
    assert (pinned["changed"], pinned["differs"]) == ([], [])
    for value in (0.5, 0.7):
        change(client, **{P_D: value})
    found = get(client, "/api/evaluation/comparison")
    assert (found["against"], found["a"]["run"]) == ("pinned", first)
    assert get(client, "/api/state")["pinned"]["differs"] == [P_D]
    assert get(client, "/api/evaluation/series?of=pinned")["run"] == first
    assert client.delete("/api/run/pin").json()["pinned"] is None
    assert client.delete("/api/run/pin").status_code == 200
    found = get(client, "/api/evaluation/comparison")
    assert (found["against"], found["a"]["changed"]) == ("previous", {P_D: 0.5})
    assert client.get("/api/evaluation/series?of=pinned").status_code == 409


@pytest.mark.full
def test_another_sequence_forgets_runs_and_pin(client: TestClient) -> None:
    client.post("/api/run/pin")
    client.post("/api/sequence", json={"name": "numbers"})
    state = get(client, "/api/state")
    assert state["sequence"]["name"] == "numbers"
    assert state["pinned"] is None


@pytest.mark.full
def test_what_is_not_there_is_said(data: Path, tmp_path: Path) -> None:
    app = create_app(Settings(data=data, with_viser=False))
    with TestClient(app, base_url=ADDRESS) as client:
        paths = (
            "evaluation",
            "evaluation/series",
            "evaluation/comparison",
            "evaluation/curves",
            "export/report.html",
        )
        for path in paths:
            assert client.get(f"/api/{path}").json()["code"] == "nothing_open"
        assert client.post("/api/run/pin").json()["code"] == "nothing_open"
        folder = tmp_path / "untrue"
        folder.mkdir()
        toml = (data / "crossing" / "sequence.toml").read_text(encoding="utf-8")
        for file in (data / "crossing").glob("*.csv"):
            (folder / file.name).write_bytes(file.read_bytes())
        (folder / "sequence.toml").write_text(toml.split("[ground_truth]")[0], encoding="utf-8")
        client.post("/api/sequence", json={"name": str(folder)})
        wait_until(run_is(client, "done"))
        for path in paths:
            error = client.get(f"/api/{path}").json()
            assert (error["code"], "has no truth" in error["detail"]) == ("no_truth", True)
        assert client.post("/api/run/pin").status_code == 200


@pytest.mark.full
def test_the_report(client: TestClient) -> None:
    answer = client.get("/api/export/report.html")
    assert answer.status_code == 200
    assert answer.headers["content-type"] == "text/html; charset=utf-8"
    assert 'filename="crossing-report.html"' in answer.headers["content-disposition"]
    assert "<h1>crossing</h1>" in answer.text
    assert ">reference<" not in answer.text
    change(client, **{P_D: 0.5})
    text = client.get("/api/export/report.html").text
    assert ">reference<" in text
    # and it leads back to where it is from, with the parameters that it was found with
    found = re.search('<a href="([^"]+)">Open in the workbench</a>', text)
    assert found is not None
    query = parse_qs(urlsplit(html.unescape(found[1])).query)
    state = client.get("/api/state").json()
    assert query == {"seq": [state["sequence"]["opened_as"]], f"p.{P_D}": ["0.5"]}


@pytest.mark.full
def test_pages_are_told(client: TestClient) -> None:
    with connect(client) as socket:
        told: list[dict[str, Any]] = []
        while not told or told[-1]["type"] != "evaluation":
            told.append(socket.receive_json())
        first = told[-1]
        assert first["run"] == get(client, "/api/state")["run"]["key"]
        assert (first["steps"], first["partial"]) == (FRAMES, False)
        command(client, "set_parameters", changes={P_D: 0.5})
        while told[-1]["type"] != "evaluation" or told[-1]["run"] == first["run"]:
            told.append(socket.receive_json())


@pytest.fixture
def sequence(crossing: Path) -> Sequence:
    return read_sequence(crossing)


@pytest.fixture
def bench(sequence: Sequence) -> Iterator[Workbench]:
    workbench = Workbench()
    with FrameReader(sequence) as reader:
        workbench.open(sequence, "key", reader, pipeline.default_parameters(sequence))
        yield workbench


def compute(bench: Workbench, steps: int | None = None) -> Run:
    """A run as the jobs report it, in this thread."""
    now = bench.snapshot()
    assert now.sequence is not None
    run = pipeline.compute(now.sequence, now.parameters, steps=steps)
    bench.run_begins(run.key)
    bench.run_progresses(run, Progress("fusion", run.done, FRAMES, 1.0, run.done))
    if steps is None:
        bench.run_ends(run.key, "done")
    return run


def shown(bench: Workbench) -> tuple[str, int] | None:
    scored = bench.snapshot().scores.shown
    return (scored.key, scored.steps) if scored is not None else None


@pytest.mark.full
def test_a_run_under_way_is_scored_as_far_as_it_is_and_set_against_as_much(
    bench: Workbench, sequence: Sequence
) -> None:
    evaluator = Evaluator(bench)
    whole = compute(bench)
    wait_until(lambda: shown(bench) == (whole.key, FRAMES))
    bench.set_parameters({P_D: 0.5}, "test")
    part = compute(bench, steps=50)
    wait_until(lambda: shown(bench) == (part.key, 50))
    scores = bench.snapshot().scores
    assert scores.reference is not None
    against, reference = scores.reference
    assert (against, reference.key) == ("previous", whole.key)
    beginning = evaluator.beginning(reference, 50)
    rows = whole.tracks.frames < 50
    assert beginning.steps == 50
    assert int(beginning.series.estimates.sum()) == int(rows.sum())
    assert evaluator.beginning(reference, 50) is beginning
    assert evaluator.beginning(reference, FRAMES) is reference.evaluation
    evaluator.close()


@pytest.mark.full
@pytest.mark.parametrize(("seconds_between", "midway"), [(0.0, 2), (3600.0, 0)])
def test_a_run_under_way_is_scored_when_its_time_has_come_and_at_its_end(
    bench: Workbench, monkeypatch: pytest.MonkeyPatch, seconds_between: float, midway: int
) -> None:
    monkeypatch.setattr(worker, "SECONDS_BETWEEN", seconds_between)
    calls: list[str] = []
    real = worker.evaluate_sequence

    def count(*arguments: Any, **settings: Any) -> Any:
        calls.append(threading.current_thread().name)
        return real(*arguments, **settings)

    monkeypatch.setattr(worker, "evaluate_sequence", count)
    evaluator = Evaluator(bench)
    now = bench.snapshot()
    assert now.sequence is not None

    def report(run: Run, progress: Progress) -> None:
        if not run.done:
            bench.run_begins(run.key)
        count = len(calls)
        bench.run_progresses(run, progress)
        if run.done and count < midway:
            wait_until(lambda: len(calls) > count)

    monkeypatch.setattr(pipeline, "PROGRESS_SECONDS", 0.0)
    run = pipeline.compute(now.sequence, now.parameters, on_progress=report)
    bench.run_ends(run.key, "done")
    wait_until(lambda: shown(bench) == (run.key, FRAMES))
    evaluator.close()
    assert len(calls) >= midway + 1 if midway else len(calls) == 1
    assert set(calls) == {"evaluation"}


def test_tracks_whose_place_another_run_is_about_to_take_are_not_scored(bench: Workbench) -> None:
    """While a slider is dragged, their figures would only keep the next run waiting."""
    first = compute(bench)
    bench.set_parameters({P_D: 0.5}, "test")
    bench.run_begins("another")
    with contextlib.closing(Evaluator(bench)):
        time.sleep(2.0 * worker.SETTLED_SECONDS)
        assert shown(bench) is None
        bench.run_ends("another", "cancelled")
        wait_until(lambda: shown(bench) == (first.key, FRAMES))


@pytest.mark.full
def test_a_pin_is_scored_though_another_run_is_shown_already(bench: Workbench) -> None:
    run = compute(bench)
    assert bench.pin()
    bench.set_parameters({P_D: 0.5}, "test")
    other = compute(bench, steps=20)
    evaluator = Evaluator(bench)

    def pinned_is_scored() -> bool:
        pinned = bench.snapshot().scores.pinned
        return pinned is not None and pinned.evaluation is not None

    wait_until(pinned_is_scored)
    wait_until(lambda: shown(bench) == (other.key, 20))
    pinned = bench.snapshot().scores.pinned
    assert pinned is not None
    assert pinned.key == run.key
    evaluator.close()


@pytest.mark.full
def test_a_failure_is_told_once_and_the_next_run_is_scored(
    bench: Workbench, monkeypatch: pytest.MonkeyPatch
) -> None:
    events: list[Any] = []
    bench.subscribe_events(events.append)
    real = worker.evaluate_sequence

    def fail(*arguments: Any, **settings: Any) -> Any:
        raise RuntimeError("a bug")

    monkeypatch.setattr(worker, "evaluate_sequence", fail)
    evaluator = Evaluator(bench)
    compute(bench)
    wait_until(lambda: bool(events))
    monkeypatch.setattr(worker, "evaluate_sequence", real)
    bench.set_parameters({P_D: 0.5}, "test")
    run = compute(bench)
    wait_until(lambda: shown(bench) == (run.key, FRAMES))
    evaluator.close()
    assert ["a bug" in event.message for event in events] == [True]


def test_only_a_finished_run_is_pinned(bench: Workbench) -> None:
    assert not bench.pin()
    compute(bench, steps=20)
    assert not bench.pin()
    run = compute(bench)
    assert bench.pin()
    pinned = bench.snapshot().scores.pinned
    assert pinned is not None
    assert pinned.key == run.key


def test_which_run_is_the_one_before(sequence: Sequence) -> None:
    run = pipeline.compute(sequence, pipeline.default_parameters(sequence))
    evaluation = evaluate_sequence(sequence, run.tracks)
    a, b, c = (replace(Scored.of(run), key=key, evaluation=evaluation) for key in ("a", "b", "c"))
    part = replace(b, steps=10, final=False)
    scores = Scores()
    assert scores.reference is None
    for scored, before in [(a, None), (part, "a"), (b, "a"), (b, "a"), (c, "b"), (part, "c")]:
        scores = scores.add(scored)
        assert scores.shown is scored
        assert (scores.before.key if scores.before else None) == before
    assert scores.pin(a).reference == ("pinned", a)
    unscored = replace(b, evaluation=None)
    assert scores.pin(unscored).pinned is b


def test_of_a_run_under_way_no_figure_is_called_better(sequence: Sequence) -> None:
    parameters = pipeline.default_parameters(sequence)
    run = pipeline.compute(sequence, parameters)
    part = pipeline.compute(sequence, with_values(parameters, {P_D: 0.05}), steps=60)
    a, b = (
        (Scored.of(one), evaluate_sequence(sequence, one.tracks, steps=part.done))
        for one in (run, part)
    )
    assert (a[0].final, b[0].final) == (True, False)
    told = comparison_of("previous", a, b)
    assert (told.a.partial, told.b.partial) == (False, True)
    assert {(row.difference, row.verdict) for row in told.rows} == {(None, "undefined")}
    assert [row.b for row in told.rows] == [figure.value for figure in b[1].figures]


def test_every_figure_is_json(client: TestClient) -> None:
    def no_constants(word: str) -> float:
        raise AssertionError(word)

    for path in ("evaluation", "evaluation/series"):
        json.loads(client.get(f"/api/{path}").text, parse_constant=no_constants)
