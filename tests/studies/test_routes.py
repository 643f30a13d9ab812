"""Studies over HTTP: defined from the sliders, run by a process of their own, read, used."""

from __future__ import annotations

import errno
import shutil
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient

from app.command.studies import _trials as command_words
from app.state.studies import StudyDesk
from app.web import studies
from app.web.dependencies import Settings
from app.web.server import create_app
from tests.app.conftest import command
from tests.studies.small import Serial, made_up, recording, run
from tracker.studies.store import Status, Store, find

ADDRESS = "http://127.0.0.1:8000"
RANGES = {"fusion.detection_probability": {"low": 0.6, "high": 0.98}, "fusion.clutter_rate": {}}


@pytest.fixture
def client(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[TestClient]:
    """A server with a small recording of boxes open, and a folder of studies."""
    monkeypatch.setenv("MULTIVIEW_PHD_STUDIES", str(tmp_path / "studies"))
    place = recording(tmp_path / "recording")
    app = create_app(Settings(sequence=str(place), with_viser=False))
    with TestClient(app, base_url=ADDRESS) as client:
        until = time.monotonic() + 60.0
        while client.get("/api/state").json()["run"]["state"] != "done":
            assert time.monotonic() < until
            time.sleep(0.02)
        yield client


def define(client: TestClient, **fields: Any) -> dict[str, Any]:
    wish = {"name": "mine", "parameters": RANGES, "trials": 5, "objectives": ["score"], **fields}
    answer = client.post("/api/studies", json=wish)
    assert answer.status_code == 200, answer.text
    found: dict[str, Any] = answer.json()
    return found


def test_a_draft_has_ranges_around_todays_values(client: TestClient) -> None:
    command(client, "set_parameters", changes={"fusion.clutter_rate": 12})
    draft = client.get("/api/studies/draft").json()
    assert draft["has_truth"]
    assert draft["objectives"] == ["hota", "idf1", "speed"]
    rate = next(one for one in draft["parameters"] if one["key"] == "fusion.clutter_rate")
    assert rate["low"] <= rate["default"] < rate["now"] == 12.0 <= rate["high"]
    asked = client.get("/api/studies/draft?keys=fusion.birth_rate,single_view").json()["parameters"]
    assert [one["key"] for one in asked] == ["fusion.birth_rate", "single_view"]
    assert "colour_phd" not in asked[1]["choices"]  # the recording has no pictures
    wrong = client.get("/api/studies/draft?keys=fusion.birth_rat")
    assert wrong.status_code == 422
    assert "did you mean fusion.birth_rate" in wrong.json()["detail"]


def test_it_is_told_what_a_study_takes_or_why_it_is_refused(client: TestClient) -> None:
    wish = {"name": "mine", "parameters": RANGES, "trials": 5, "seeds": 3}
    cost = client.post("/api/studies/estimate", json=wish).json()
    assert cost["runs"] == 15
    assert cost["error"] is None
    assert cost["words"].startswith("up to 15 runs")
    wish["parameters"] = {"fusion.detection_probability": {"high": 1.5}}
    cost = client.post("/api/studies/estimate", json=wish).json()
    assert "must be between" in cost["error"]
    refused = client.post("/api/studies", json=wish)
    assert refused.status_code == 422
    assert "must be between" in refused.json()["detail"]


def test_the_time_goes_by_the_workers_that_are_wanted(
    client: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(studies, "available_cores", lambda: 4)
    monkeypatch.setattr(studies, "FEWEST_STEPS", 1)
    # so many runs that a recording of a second takes hours
    wish = {"name": "mine", "parameters": RANGES, "trials": 10**6}

    def cost(**place: Any) -> dict[str, Any]:
        found: dict[str, Any] = client.post("/api/studies/estimate", json=wish | place).json()
        assert found["error"] is None
        return found

    one = cost(workers=1)
    assert one["words"].endswith("with 1 worker")
    assert one["seconds"] == pytest.approx(2.0 * cost(workers=2)["seconds"])
    assert cost(workers=2)["words"].endswith("with 2 workers")
    assert cost()["words"].endswith("with 4 workers")
    more = cost(workers=8)
    assert more["words"].endswith("with 8 workers on 4 cores")
    assert more["seconds"] == pytest.approx(one["seconds"] / 4.0)
    assert cost(workers=1, minutes=3)["seconds"] == 180.0
    there = cost(scheduler="tcp://10.0.0.1:8786")
    assert there["seconds"] is None
    assert there["words"].endswith("of one worker's time")
    refused = client.post("/api/studies/estimate", json=wish | {"workers": 1000}).json()
    assert refused["error"].startswith("workers: expected 1 to ")
    refused = client.post("/api/studies/estimate", json=wish | {"scheduler": ""}).json()
    assert refused["error"].startswith("scheduler: expected an address as tcp://10.0.0.1:8786")


@pytest.mark.full
def test_a_study_goes_on_where_it_ran(
    client: TestClient, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lines: list[list[str]] = []
    monkeypatch.setattr(StudyDesk, "run", lambda _, store, line: lines.append(line[5:]))
    define(client)
    start = "/api/studies/mine/start"
    for place in ({}, {"workers": 1}, {}, {"scheduler": "tcp://10.0.0.1:8786"}, {}):
        answer = client.post(start, json=place)
        assert answer.status_code == 200, answer.text
    here, there = ["--workers", "1"], ["--scheduler", "tcp://10.0.0.1:8786"]
    assert [line[1:] for line in lines] == [[], here, here, there, there]
    (tmp_path / "studies" / "mine" / "place.json").write_text('{"workers": "many"}')
    answer = client.post(start, json={})
    assert answer.status_code == 409
    assert "place.json, workers: expected" in answer.json()["detail"]
    assert client.post(start, json={"workers": 1}).status_code == 200


@pytest.mark.full
def test_where_the_time_alone_ends_it_no_number_of_trials_is_told(
    client: TestClient, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(StudyDesk, "run", lambda *_: None)
    told = client.post("/api/studies/tune", json={"minutes": 2}).json()
    assert told["info"]["trials"] is None
    store = find(told["info"]["name"], tmp_path / "studies")
    assert store.definition().within() == "in 2 minutes"
    assert command_words(store, Status("running", done=7, trials=10**6)) == "7 trials"
    bounded = define(client, minutes=2)
    assert bounded["info"]["trials"] == 5
    store = find("mine", tmp_path / "studies")
    assert command_words(store, Status("running", done=1, trials=5)) == "1 of 5 trials"


@pytest.mark.full
def test_what_is_on_the_sliders_is_held_and_tried(client: TestClient) -> None:
    changes = {"fusion.clutter_rate": 12, "fusion.acceleration_sigma": 2.5}
    command(client, "set_parameters", changes=changes)
    made = define(client)
    assert made["info"]["state"] == "new"
    assert made["definition"]["values"] == {"fusion.acceleration_sigma": 2.5}
    assert made["definition"]["start"] == {"fusion.clutter_rate": 12.0}
    again = client.post(
        "/api/studies", json={"name": "mine", "parameters": RANGES, "objectives": ["score"]}
    )
    assert again.status_code == 422
    assert 'there is a study "mine" already' in again.json()["detail"]


@pytest.mark.full
def test_trials_are_read_used_and_kept(client: TestClient, tmp_path: Path) -> None:
    define(client, trials=30)
    store = find("mine", tmp_path / "studies")
    run(store, Serial(made_up(lambda v: float(v.get("fusion.clutter_rate", 3.0)) / 50.0)))
    told = client.get("/api/studies/mine").json()
    assert told["info"]["done"] == 30
    assert told["importance"][0]["key"] == "fusion.clutter_rate"
    assert told["importance"][0]["share"] > 0.5
    best = told["best"]
    trials = client.get("/api/studies/mine/trials").json()
    assert len(trials["trials"]) == 30
    assert client.get(f"/api/studies/mine/trials?after={trials['last']}").json()["trials"] == []
    detail = client.get(f"/api/studies/mine/trials/{best}").json()
    assert detail["commands"][0].startswith("multiview-phd track ")
    state = command(client, "use_trial", study="mine", trial=best).json()
    for key, value in detail["trial"]["values"].items():
        assert state["parameters"][key] == value
    assert set(state["changed"]) <= set(detail["trial"]["values"])
    kept = command(client, "keep_trial", study="mine", trial=best, preset="found").json()
    assert kept["presets"] == ["found"]
    assert kept["preset"] == "found"
    back = command(client, "use_trial", study="mine", trial=0).json()
    assert back["changed"] == []
    report = client.get("/api/studies/mine/export/report.html")
    assert "<h1>Study mine</h1>" in report.text
    table = client.get("/api/studies/mine/export/trials.csv").text.splitlines()
    assert len(table) == 31
    assert client.get("/api/studies/mine/export/study.json").json()["best"] == best


@pytest.mark.full
def test_what_is_not_there_is_told(client: TestClient) -> None:
    for path in ("/api/studies/nothing", "/api/studies/nothing/trials"):
        answer = client.get(path)
        assert answer.status_code == 404
        assert 'expected the study "nothing", found none' in answer.json()["detail"]
    define(client)
    answer = client.get("/api/studies/mine/trials/3")
    assert answer.status_code == 404
    assert "no trial 3 has ended" in answer.json()["detail"]
    looked = client.post("/api/studies/scheduler", json={"address": "tcp://127.0.0.1:9"}).json()
    assert looked["error"].startswith("there is no Dask scheduler at tcp://127.0.0.1:9")
    for none in ("\x9c&\x95\x84ºå", "tcp://", "here", "tcp://127.0.0.1:99999", "a b:1"):
        answer = client.post("/api/studies/scheduler", json={"address": none})
        assert answer.status_code == 200
        assert "expected an address as tcp://10.0.0.1:8786" in answer.json()["error"]


def test_no_more_workers_than_the_machine_can_bear(client: TestClient) -> None:
    before = client.get("/api/studies").json()
    for body in ({"workers": 1024}, {"workers": 1000, "minutes": 1}):
        answer = client.post("/api/studies/tune", json=body)
        assert answer.status_code == 409
        assert "workers: expected 1 to " in answer.json()["detail"]
    assert client.get("/api/studies").json() == before


@contextmanager
def just_ending(store: Store) -> Iterator[threading.Event]:
    """A study that somebody asked to stop, and that runs for a moment yet; set when it ends."""
    holds, ends = threading.Event(), threading.Event()

    def ending() -> None:
        with store.running():
            store.ask_to_stop()
            holds.set()
            ends.wait(30.0)

    other = threading.Thread(target=ending)
    other.start()
    assert holds.wait(30.0)
    threading.Timer(0.3, ends.set).start()
    yield ends
    other.join()


def test_who_goes_on_at_once_waits_for_what_is_just_ending(
    client: TestClient, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    define(client)
    store = find("mine", tmp_path / "studies")
    begun: list[bool] = []
    monkeypatch.setattr(StudyDesk, "run", lambda *_: begun.append(store.is_running()))
    with just_ending(store) as ends:
        answer = client.post("/api/studies/mine/start", json={"workers": 1})
        assert answer.status_code == 200, answer.text
        assert ends.is_set()
    assert begun == [False]


def test_what_is_just_ending_is_deleted_with_the_last_that_it_writes(
    client: TestClient, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    define(client)
    store = find("mine", tmp_path / "studies")
    tried: list[Path] = []

    def late(folder: Path) -> None:
        tried.append(folder)
        if len(tried) == 1:
            raise OSError(errno.ENOTEMPTY, "Directory not empty", str(folder))
        remove(folder)

    remove = shutil.rmtree
    monkeypatch.setattr(shutil, "rmtree", late)
    with just_ending(store) as ends:
        answer = client.delete("/api/studies/mine")
        assert answer.json()["studies"] == [], answer.text
        assert ends.is_set()
    assert len(tried) == 2
    assert not store.folder.exists()


@pytest.mark.full
def test_a_process_of_its_own_runs_it_and_is_stopped(client: TestClient) -> None:
    define(client, trials=500)
    with client.websocket_connect("ws://127.0.0.1:8000/api/stream") as socket:
        started = client.post("/api/studies/mine/start", json={"workers": 1}).json()
        assert started["info"]["state"] == "running"
        again = client.post("/api/studies/mine/start")
        assert again.status_code == 409
        assert "runs already" in again.json()["detail"]
        heard: list[dict[str, Any]] = []
        until = time.monotonic() + 60.0
        while not heard or heard[-1]["done"] < 2:
            assert time.monotonic() < until
            message = socket.receive_json()
            if message["type"] == "study":
                heard.append(message["study"])
    workers = client.get("/api/studies/mine").json()["status"]["workers"]
    assert len(workers) == 1
    assert client.delete("/api/studies/mine").status_code == 409
    stopped = client.post("/api/studies/mine/stop").json()
    assert stopped["info"]["state"] == "stopped"
    assert stopped["info"]["done"] >= 2
    assert client.delete("/api/studies/mine").json()["studies"] == []
