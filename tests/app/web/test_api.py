"""The HTTP routes against the engine's own numbers, and the words of what goes wrong."""

from __future__ import annotations

import csv
import io
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from fastapi.routing import APIRoute
from starlette.testclient import TestClient

from app.web.access import gateway
from app.web.dependencies import Settings
from app.web.server import ROUTERS, create_app
from tests.app.conftest import ADDRESS, command, run_is, wait_until
from tests.app.folders import FRAMES
from tests.synthetic import number_in
from tracker.export import tracks_csv
from tracker.parameters.catalogue import PARAMETERS
from tracker.parameters.values import with_values
from tracker.runs import pipeline
from tracker.sequences.reader import read_sequence

P_D = "fusion.detection_probability"


@pytest.fixture
def empty(data: Path) -> Iterator[TestClient]:
    """The application with nothing open."""
    app = create_app(Settings(data=data, with_viser=False))
    with TestClient(app, base_url=ADDRESS) as client:
        yield client


PROBLEM = {"type", "title", "status", "detail", "code", "field", "hint"}


def assert_error(answer: Any, status: int, code: str, *words: str) -> None:
    assert answer.status_code == status
    assert answer.headers["content-type"] == "application/problem+json"
    error = answer.json()
    assert set(error) == PROBLEM
    assert error["status"] == status
    assert error["code"] == code
    for word in words:
        assert word in error["detail"]


def test_state(client: TestClient) -> None:
    state = client.get("/api/state").json()
    assert state["sequence"]["name"] == "crossing"
    assert [camera["name"] for camera in state["sequence"]["cameras"]] == ["left", "right", "back"]
    assert state["sequence"]["frames"] == FRAMES
    assert state["sequence"]["has_truth"]
    assert not state["sequence"]["has_pictures"]
    assert state["methods"]["single_view"] == "none"
    assert state["changed"] == []
    assert state["run"]["done"] == FRAMES
    assert set(state["parameters"]) == set(PARAMETERS)
    assert state["viser"]["path"] == "/viser/"


def test_nothing_open(empty: TestClient) -> None:
    state = empty.get("/api/state").json()
    assert state["sequence"] is None
    assert state["run"]["state"] == "idle"
    assert_error(empty.get("/api/step/0"), 409, "nothing_open")
    assert_error(empty.get("/api/timeline"), 409, "nothing_open")
    assert_error(empty.get("/api/export/tracks.csv"), 409, "nothing_computed")
    assert_error(empty.get("/api/picture/x/0/0.jpg"), 404, "no_picture")
    assert empty.post("/api/run/cancel").status_code == 200
    assert empty.post("/api/run").status_code == 200
    assert_error(empty.post("/api/view", json={"camera": 0}), 422, "bad_parameter", "below 0")


@pytest.mark.full
def test_sequences_lists_the_data_folder(client: TestClient, data: Path) -> None:
    broken = data / "broken"
    broken.mkdir()
    (broken / "sequence.toml").write_text("format = 1\nname =")
    try:
        listed = {e["name"]: e for e in client.get("/api/sequences").json()["sequences"]}
    finally:
        (broken / "sequence.toml").unlink()
        broken.rmdir()
    assert listed["crossing"]["kind"] == "folder"
    assert listed["crossing"]["error"] is None
    assert listed["crossing"]["folder"] == client.get("/api/state").json()["sequence"]["folder"]
    assert listed["room44-3p"]["kind"] == "rendered"
    assert "sequence.toml" in listed["broken"]["error"]


def test_steps_equal_the_engines(client: TestClient, crossing: Path) -> None:
    sequence = read_sequence(crossing)
    run = pipeline.compute(sequence, pipeline.default_parameters(sequence))
    some = 0
    for step in range(0, FRAMES, 7):
        message = client.get(f"/api/step/{step}").json()
        rows = run.tracks.at(step)
        assert message["run"] == run.key
        assert message["computed"]
        assert [t["id"] for t in message["tracks"]] == run.tracks.ids[rows].tolist()
        np.testing.assert_array_equal(
            np.array([t["position"] for t in message["tracks"]]).reshape(-1, 3),
            run.tracks.positions[rows],
        )
        assert message["components"] == run.fused[step].posterior.size
        for index, camera in enumerate(message["cameras"]):
            boxes, visible = sequence.cameras[index].project_boxes(
                run.tracks.positions[rows], sequence.target_half_extents
            )
            for i, track in enumerate(camera["tracks"]):
                some += 1
                assert track["visible"] == visible[i]
                assert (track["reason"] is None) == visible[i]
                assert track["seen"] == run.tracks.seen[rows][i, index]
                np.testing.assert_allclose(track["box"], boxes[i], atol=0.006)
            view = run.views[step][index]
            assert len(camera["measurements"]) == len(view.measurements)
            for shown, box in zip(camera["measurements"], view.measurements, strict=True):
                left, top, width, height = shown["box"]
                np.testing.assert_allclose(
                    [left + width / 2, top + height / 2, width / 2, height / 2], box, atol=0.02
                )
            assert camera["samples"] is None
            assert camera["dropped"] is None
        assert len(message["truth"]) == 2
    assert some > 50
    asked = client.get("/api/step/5?samples=1").json()
    assert asked["cameras"][0]["samples"] == []
    assert asked["cameras"][0]["dropped"] == []


@pytest.mark.parametrize("details", ["", "&samples=1&trails=1&seconds=2"])
def test_several_steps_are_those_that_are_asked_for(client: TestClient, details: str) -> None:
    several = client.get(f"/api/steps?step=7&step=3&step=7{details}").json()
    assert several == [client.get(f"/api/step/{k}?{details}").json() for k in (7, 3, 7)]


def test_a_step_that_is_not_there(client: TestClient) -> None:
    assert_error(client.get("/api/step/120"), 404, "no_step", "0 … 119")
    assert_error(client.get("/api/steps?step=3&step=120"), 404, "no_step", "0 … 119")
    assert_error(client.get("/api/steps"), 422, "bad_request", "step")
    assert_error(client.get("/api/steps?" + "&step=1" * 65), 422, "bad_request", "step")
    assert_error(client.get("/api/step/-1"), 404, "no_step")
    assert_error(client.get("/api/step/now"), 422, "bad_request", "step")


@pytest.mark.full
def test_the_timeline_counts_what_the_engine_reports(client: TestClient, crossing: Path) -> None:
    sequence = read_sequence(crossing)
    run = pipeline.compute(sequence, pipeline.default_parameters(sequence))
    timeline = client.get("/api/timeline").json()
    assert timeline["done"] == timeline["frames"] == FRAMES
    np.testing.assert_allclose(
        timeline["cardinality"]["mean"], [f.posterior.cardinality for f in run.fused], atol=1e-4
    )
    count = np.bincount(run.tracks.frames, minlength=FRAMES).tolist()
    assert timeline["count"] == {"low": count, "high": count, "mean": count}
    assert timeline["truth"]["low"] == timeline["truth"]["high"] == [2] * FRAMES
    assert (timeline["first"], timeline["stride"], timeline["left_out"]) == (0, 1, 0)
    covered = set()
    for track in timeline["tracks"]:
        assert track["first"] == track["spans"][0][0]
        assert track["last"] == track["spans"][-1][1]
        for (_, end, _), (begin, _, _) in zip(track["spans"], track["spans"][1:], strict=False):
            assert begin > end
        for begin, end, word in track["spans"]:
            for step in range(begin, end + 1):
                covered.add((step, track["id"], word == "seen"))
    tracks = run.tracks
    assert covered == set(
        zip(
            tracks.frames.tolist(),
            tracks.ids.tolist(),
            tracks.seen.any(axis=1).tolist(),
            strict=True,
        )
    )


def test_the_csv_is_the_engines(client: TestClient, crossing: Path, tmp_path: Path) -> None:
    command(client, "set_parameters", changes={P_D: 0.9})
    wait_until(run_is(client, "done"))
    answer = client.get("/api/export/tracks.csv")
    assert answer.headers["content-type"].startswith("text/csv")
    assert "crossing-tracks.csv" in answer.headers["content-disposition"]
    assert answer.headers["x-run-partial"] == "false"
    sequence = read_sequence(crossing)
    wanted = with_values(pipeline.default_parameters(sequence), {P_D: 0.9})
    run = pipeline.compute(sequence, wanted)
    assert answer.headers["x-run-key"] == run.key
    path = tmp_path / "tracks.csv"
    tracks_csv.save_tracks_csv(path, sequence, run.tracks, wanted, 0)
    assert answer.text == path.read_text(encoding="utf-8")
    rows = [line for line in io.StringIO(answer.text) if not line.startswith("#")]
    assert len(list(csv.DictReader(rows))) == len(run.tracks) > 0


@pytest.mark.full
def test_parameters_are_set_and_what_differs_is_told(client: TestClient) -> None:
    state = command(client, "set_parameters", changes={P_D: 0.9}).json()
    assert state["parameters"][P_D] == 0.9
    assert state["changed"] == [P_D]
    state = command(client, "apply_preset", preset="published").json()
    assert state["parameters"][P_D] == 0.98
    state = command(client, "reset_parameters", keys=["fusion.motion"]).json()
    assert "fusion.motion" not in state["changed"]
    assert command(client, "reset_parameters").json()["changed"] == []


@pytest.mark.full
@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({P_D: 7}, ("Detection probability: must be between 0.05 and 1", "got 7")),
        ({"fusion.detection_probabilty": 0.5}, ("did you mean fusion.detection_probability",)),
        ({P_D: "high"}, ("expected a number",)),
        ({"single_view": "magic"}, ("expected one of", "colour_phd")),
    ],
)
def test_a_value_that_does_not_fit(
    client: TestClient, changes: dict[str, Any], words: tuple[str, ...]
) -> None:
    before = client.get("/api/state").json()
    wish = {"fusion.birth_rate": 1.0, **changes}
    answer = command(client, "set_parameters", changes=wish)
    assert_error(answer, 422, "bad_parameter", *words)
    assert answer.json()["field"] == next(iter(changes))
    assert client.get("/api/state").json()["parameters"] == before["parameters"]


@pytest.mark.full
@pytest.mark.parametrize(
    ("method", "path", "json", "status"),
    [
        ("POST", "/api/commands", {"name": "set_parameters", "changs": {}}, 422),
        ("POST", "/api/commands", [1], 422),
        ("POST", "/api/commands", {"name": "apply_preset"}, 422),
        ("POST", "/api/sequence", {"name": ""}, 422),
        ("POST", "/api/select", {"id": "first"}, 422),
        ("PATCH", "/api/layers", {"changes": {"clouds": True}}, 422),
        ("GET", "/api/nothing", None, 404),
        ("GET", "/static/nothing.js", None, 404),
        ("DELETE", "/api/state", None, 405),
    ],
)
def test_every_failure_has_the_one_shape(
    client: TestClient, method: str, path: str, json: Any, status: int
) -> None:
    answer = client.request(method, path, json=json)
    assert answer.status_code == status
    error = answer.json()
    assert set(error) == PROBLEM
    assert error["detail"]


def test_a_failure_of_our_own_has_the_one_shape_too(
    data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: Any) -> None:
        raise RuntimeError("a bug")

    monkeypatch.setattr("app.web.results.schema", fail)
    app = create_app(Settings(data=data, with_viser=False))
    with TestClient(app, base_url=ADDRESS, raise_server_exceptions=False) as client:
        assert_error(client.get("/api/schema"), 500, "internal", "RuntimeError", "a bug")


@pytest.mark.full
def test_playhead_selection_layers_view(client: TestClient) -> None:
    assert client.post("/api/seek", json={"step": 500}).json()["playhead"] == FRAMES - 1
    assert client.post("/api/select", json={"id": 3}).json()["selection"] == 3
    assert client.post("/api/select", json={"id": None}).json()["selection"] is None
    layers = client.patch("/api/layers", json={"changes": {"trails": False}}).json()["layers"]
    assert not layers["trails"]
    for view in (2, "top", None):
        assert client.post("/api/view", json={"camera": view}).json()["view"] == view
    assert_error(client.post("/api/view", json={"camera": 3}), 422, "bad_parameter", "below 3")
    assert client.post("/api/theme", json={"theme": "light"}).json()["theme"] == "light"
    assert_error(client.post("/api/theme", json={"theme": "red"}), 422, "bad_request", "theme")


@pytest.mark.full
def test_opening_what_cannot_be_opened_leaves_what_was_open(client: TestClient) -> None:
    answer = client.post("/api/sequence", json={"name": "nonsense"})
    assert_error(answer, 422, "cannot_open", "nonsense")
    state = client.get("/api/state").json()
    assert state["sequence"]["name"] == "crossing"
    assert state["opening"] is None
    assert state["run"]["state"] == "done"


@pytest.mark.full
def test_pictures_are_those_of_their_step(client: TestClient) -> None:
    state = client.post("/api/sequence", json={"name": "numbers"}).json()
    wait_until(lambda: client.get("/api/state").json()["sequence"]["name"] == "numbers")
    state = client.get("/api/state").json()
    key = state["sequence"]["key"]
    for step in (0, 17, 3, 29, 3):
        for camera in (0, 1):
            answer = client.get(f"/api/picture/{key}/{camera}/{step}.jpg")
            assert answer.headers["content-type"] == "image/jpeg"
            assert "immutable" in answer.headers["cache-control"]
            picture = cv2.imdecode(np.frombuffer(answer.content, np.uint8), cv2.IMREAD_COLOR)
            assert picture is not None
            assert picture.shape == (144, 192, 3)
            assert number_in(picture) == step
    small = client.get(f"/api/picture/{key}/0/4.jpg?w=96").content
    decoded = cv2.imdecode(np.frombuffer(small, np.uint8), cv2.IMREAD_COLOR)
    assert decoded is not None
    assert decoded.shape == (72, 96, 3)
    for path in (f"{key}/0/30", f"{key}/2/0", f"{key}/-1/0", "other/0/0"):
        assert_error(client.get(f"/api/picture/{path}.jpg"), 404, "no_picture")
    assert client.get(f"/api/picture/{key}/0/0.jpg?w=4").status_code == 422


@pytest.mark.full
def test_pictures_asked_for_at_once_are_decoded_once(
    client: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    client.post("/api/sequence", json={"name": "numbers"})
    wait_until(lambda: client.get("/api/state").json()["sequence"]["name"] == "numbers")
    key = client.get("/api/state").json()["sequence"]["key"]
    encoded: list[int] = []
    real = cv2.imencode

    def count(*args: Any) -> Any:
        encoded.append(1)
        return real(*args)

    monkeypatch.setattr("app.web.pictures.cv2.imencode", count)
    answers: list[bytes] = []

    def ask() -> None:
        answers.append(client.get(f"/api/picture/{key}/1/11.jpg").content)

    threads = [threading.Thread(target=ask) for _ in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(set(answers)) == 1
    assert len(encoded) == 1


@pytest.mark.full
def test_the_page_and_its_files_are_checked_by_their_etag(client: TestClient) -> None:
    for path in ("/", "/static/js/main.js"):
        answer = client.get(path)
        assert answer.status_code == 200
        assert answer.headers["cache-control"] == "no-cache"
        again = client.get(path, headers={"if-none-match": answer.headers["etag"]})
        assert again.status_code == 304
    # browsers want the icon again with every change of the address
    assert client.get("/static/icon.svg").headers["cache-control"] == "max-age=86400"
    policy = client.get("/").headers["content-security-policy"]
    assert "script-src 'self'; style-src 'self';" in policy
    assert policy.endswith("require-trusted-types-for 'script'; trusted-types 'none'")


@pytest.mark.full
def test_every_route_is_documented(client: TestClient) -> None:
    document = client.get("/openapi.json").json()
    documented = {
        (method.upper(), path) for path, item in document["paths"].items() for method in item
    }
    served = {
        (method, route.path_format)
        for router in ROUTERS
        if router is not gateway.router  # viser's own pages
        for route in router.routes
        if isinstance(route, APIRoute)
        for method in route.methods
    }
    assert served == documented
    assert {path for _, path in served} >= {"/api/state", "/api/schema", "/api/step/{step}"}
    for item in document["paths"].values():
        for operation in item.values():
            assert operation["description"].rstrip().endswith(".")
            assert "4XX" in operation["responses"]
    for name, model in document["components"]["schemas"].items():
        if name not in ("HTTPValidationError", "ValidationError"):
            assert model.get("description"), name


@pytest.mark.full
def test_the_page_of_the_routes_loads_nothing_from_another_host(client: TestClient) -> None:
    page = client.get("/docs").text
    assert "//" not in page.replace("<!--", "").split("<script>")[0]
    for path in ("/docs-files/swagger-ui-bundle.js", "/docs-files/swagger-ui.css"):
        assert path in page
        assert client.get(path).status_code == 200


def test_a_body_that_is_no_json_is_said_to_be_none(empty: TestClient) -> None:
    answer = empty.post(
        "/api/commands", content="{changes", headers={"content-type": "application/json"}
    )
    assert_error(answer, 422, "bad_request", "not JSON", "at byte 1")
