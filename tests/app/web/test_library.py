"""The library through the routes: runs are kept by themselves, shown again, named and deleted."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from starlette.testclient import TestClient

from app.state import keeper
from app.web import running
from app.web.dependencies import Settings
from app.web.server import create_app
from tests.app.conftest import ADDRESS, command, is_evaluated, run_is, wait_until
from tests.library.runs import made_by_the_version_before, tracks
from tests.library.runs import run as made
from tracker.library.errors import LibraryError
from tracker.library.keeping import record_of_recording
from tracker.library.store import Library
from tracker.sequences.reader import WHERE_NOW, read_sequence

P_D = "fusion.detection_probability"


@pytest.fixture(autouse=True)
def nobody_drags(monkeypatch: pytest.MonkeyPatch) -> None:
    """A run is stored soon after its end: it waits no longer for a slider that is being dragged."""
    monkeypatch.setattr(keeper, "DRAG_SECONDS", 0.2)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "library.sqlite3"


def application(data: Path, path: Path | None, sequence: str | None = "crossing") -> TestClient:
    settings = Settings(sequence=sequence, data=data, with_viser=False, library=path)
    return TestClient(create_app(settings), base_url=ADDRESS)


@pytest.fixture
def kept(data: Path, path: Path) -> Iterator[TestClient]:
    """The application with two kept runs of ``crossing``: the default, and p_D 0.8, shown."""
    with application(data, path) as client:
        wait_until(lambda: len(runs_of(client)) == 1)
        command(client, "set_parameters", changes={P_D: 0.8})
        wait_until(lambda: len(runs_of(client)) == 2)
        yield client


def runs_of(client: TestClient, name: str = "crossing") -> list[dict]:
    listed = client.get("/api/library").json()["recordings"]
    known = [r["id"] for r in listed if r["name"] == name and r["id"] is not None]
    return client.get(f"/api/library/recordings/{known[0]}/runs").json()["runs"] if known else []


@pytest.mark.full
def test_finished_runs_are_kept_with_their_figures(kept: TestClient) -> None:
    changed, default = runs_of(kept)
    assert default["changes"] == []
    assert [(c["key"], c["value"]) for c in changed["changes"]] == [(P_D, "0.8")]
    evaluation = kept.get("/api/evaluation").json()
    figures = {figure["name"]: figure["value"] for figure in evaluation["figures"]}
    assert changed["mota"] == figures["mota"]
    assert changed["source"] == "page"
    assert not changed["older_code"]
    listed = kept.get("/api/library").json()
    (recording,) = [r for r in listed["recordings"] if r["name"] == "crossing"]
    assert (recording["runs"], recording["people"], recording["boxes_only"]) == (2, 2, True)
    # what was never opened can be opened from there all the same
    (never,) = [r for r in listed["recordings"] if r["name"] == "numbers"]
    assert (never["id"], never["runs"]) == (None, 0)
    command(kept, "set_parameters", changes={"smoothing_method": "none"})
    wait_until(lambda: len(runs_of(kept)) == 3)
    method = runs_of(kept)[0]["changes"][0]
    assert (method["default"], method["value"]) == ("identities", "none")


@pytest.mark.full
def test_a_kept_run_names_its_people(kept: TestClient, data: Path) -> None:
    track = kept.get("/api/timeline").json()["tracks"][0]
    wish = {"kind": "name", "tracks": [track["id"]], "name": "Anna", "step": track["first"] + 9}
    command(kept, "correct", corrections=[wish])
    wait_until(lambda: len(runs_of(kept)) == 3)
    named, *_, default = runs_of(kept)
    for run, name in ((default, None), (named, "Anna")):
        state = kept.post(f"/api/library/runs/{run['id']}/open").json()
        assert state["run"]["kept"] == run["id"]  # whatever was corrected since
        (shown,) = [
            life for life in kept.get("/api/timeline").json()["tracks"] if life["id"] == track["id"]
        ]
        assert shown["name"] == name
    (data / "crossing" / "corrections.toml").unlink()  # other tests open it without


@pytest.mark.full
def test_a_kept_run_names_whom_its_colours_named(
    data: Path, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(running, "names_of", lambda run: {int(run.tracks.ids[0]): "Bo"})
    with application(data, path) as client:
        wait_until(lambda: len(runs_of(client)) == 1)
        before = [life["name"] for life in client.get("/api/timeline").json()["tracks"]]
        client.post(f"/api/library/runs/{runs_of(client)[0]['id']}/open")
        after = [life["name"] for life in client.get("/api/timeline").json()["tracks"]]
    assert (before, after) == ([None, None], ["Bo", None])


@pytest.mark.full
def test_a_preview_has_the_distance_to_the_truth_in_small(kept: TestClient) -> None:
    changed, _ = runs_of(kept)
    ospa = kept.get("/api/evaluation/series").json()["ospa"]
    told = kept.get(f"/api/library/runs/{changed['id']}").json()
    np.testing.assert_allclose(told["ospa"], ospa, atol=2e-3)
    assert told["ospa_every"] == 1


@pytest.mark.full
def test_a_recording_that_was_moved_is_found_again(data: Path, path: Path, tmp_path: Path) -> None:
    before, after = tmp_path / "before", tmp_path / "after"
    shutil.copytree(data / "crossing", before)
    with application(data, path, str(before)) as client:
        wait_until(lambda: len(runs_of(client)) == 1)
        before.rename(after)
        (recording,) = [
            r for r in client.get("/api/library").json()["recordings"] if r["place"] == str(before)
        ]
        assert recording["missing"]
        address = f"/api/library/recordings/{recording['id']}/place"
        other = client.post(address, json={"place": str(data / "numbers")})
        assert other.status_code == 422
        assert "another content" in other.json()["detail"]
        told = client.post(address, json={"place": str(after)}).json()
        assert (told["place"], told["missing"]) == (str(after), None)
        number = runs_of(client)[0]["id"]
        shown = client.post(f"/api/library/runs/{number}/open").json()
        wait_until(lambda: client.get("/api/state").json()["run"]["kept"] == number)
        assert "detail" not in shown


def test_what_was_not_saved_goes_where_the_recording_went(
    data: Path, path: Path, tmp_path: Path
) -> None:
    before, after = tmp_path / "before", tmp_path / "after"
    shutil.copytree(data / "crossing", before)
    with application(data, path, str(before)) as client:
        wait_until(lambda: len(runs_of(client)) == 1)
        (recording,) = [
            r for r in client.get("/api/library").json()["recordings"] if r["place"] == str(before)
        ]
        face = {"side": "max", "axis": 1}
        assert command(client, "set_room_face", **face, value=2.5).status_code == 204
        before.rename(after)
        address = f"/api/library/recordings/{recording['id']}/place"
        assert client.post(address, json={"place": str(after)}).status_code == 200
        # what was opened before is still open, from where it was
        assert command(client, "set_room_face", **face, value=2.25).status_code == 204
        assert client.post("/api/sequence", json={"name": str(after)}).status_code == 200
        wait_until(lambda: client.get("/api/state").json()["sequence"]["opened_as"] == str(after))
        assert client.get("/api/state").json()["teaching"]["unsaved"] == 1
        assert client.get("/api/state").json()["sequence"]["room"]["max"][1] == 2.25
        assert command(client, "save_taught").status_code == 204


@pytest.mark.full
@pytest.mark.parametrize("saved", [False, True])
def test_a_recording_is_found_again_after_its_room_was_edited(
    data: Path, path: Path, tmp_path: Path, saved: bool
) -> None:
    before, after = tmp_path / "before", tmp_path / "after"
    shutil.copytree(data / "crossing", before)
    with application(data, path, str(before)) as client:
        wait_until(run_is(client, "done"))
        (recording,) = [
            r for r in client.get("/api/library").json()["recordings"] if r["place"] == str(before)
        ]
        address = f"/api/library/recordings/{recording['id']}"
        face = {"side": "max", "axis": 1, "value": 2.5}
        assert command(client, "set_room_face", **face).status_code == 204
        if saved:
            assert command(client, "save_taught").status_code == 204
            assert command(client, "set_room_face", **face | {"value": 2.25}).status_code == 204
        wait_until(run_is(client, "done"))
        wait_until(lambda: client.get(f"{address}/runs").json()["runs"] != [])
        key = client.get("/api/state").json()["run"]["key"]
        with Library(path) as library:
            wait_until(lambda: library.with_key(key) is not None)
            library._connection.execute("DELETE FROM runs WHERE key != ?", (key,))
        before.rename(after)
        told = client.post(f"{address}/place", json={"place": str(after)})
        assert told.status_code == 200, told.text


def test_the_digest_of_a_run_tells_its_recording(data: Path, path: Path, tmp_path: Path) -> None:
    """An earlier version stored that of a state that was not saved with the recording."""
    after = tmp_path / "after"
    shutil.copytree(data / "crossing", after)
    opened = read_sequence(after)
    gone = replace(record_of_recording(opened, ""), place=str(tmp_path / "gone"), digest="edited")
    with Library(path) as library:
        library.keep(gone, made(1, digest=opened.digest))
    with application(data, path, None) as client:
        told = client.post("/api/library/recordings/1/place", json={"place": str(after)})
        assert told.status_code == 200, told.text


@pytest.mark.full
def test_a_run_that_was_deleted_and_is_made_again_is_kept_again(kept: TestClient) -> None:
    _, default = runs_of(kept)
    command(kept, "delete_runs", runs=[default["id"]])
    assert len(runs_of(kept)) == 1
    command(kept, "reset_parameters", keys=[P_D])
    wait_until(lambda: [run["id"] for run in runs_of(kept)][:1] == [default["id"]])


@pytest.mark.full
def test_of_the_runs_that_a_dragged_slider_passes_none_is_kept(
    data: Path, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(keeper, "DRAG_SECONDS", 2.0)
    with application(data, path) as client:
        wait_until(lambda: len(runs_of(client)) == 1)
        for value in (0.8, 0.85, 0.9):
            command(client, "set_parameters", changes={P_D: value})
            wait_until(run_is(client, "done"))
        wait_until(lambda: len(runs_of(client)) == 2)
        kept, _ = runs_of(client)
    assert [(c["key"], c["value"]) for c in kept["changes"]] == [(P_D, "0.9")]


@pytest.mark.full
def test_a_library_that_cannot_be_used_for_a_while_keeps_runs_again_afterwards(
    data: Path, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    free = False

    def opened(path: Path) -> Library:
        if not free:
            raise LibraryError(f"{path}: another program holds the library")
        return Library(path)

    monkeypatch.setattr(keeper, "open_library", opened)
    monkeypatch.setattr(keeper, "RETRY_SECONDS", 0.2)
    with application(data, path) as client:
        wait_until(lambda: run_is(client, "done"))
        assert "another program holds" in client.get("/api/library").json()["error"]
        free = True
        wait_until(lambda: len(runs_of(client)) == 1)
        assert client.get("/api/library").json()["error"] is None


def assert_same_tracks(found: str, given: str) -> None:
    """Two files of tracks are the same, covariances as the library rounds them: σ below 0.1 m."""
    covariances, others = [], []
    for text in (found, given):
        rows = [line.split(",") for line in text.splitlines()]
        at = next(row.index("covariance_xy") for row in rows if "covariance_xy" in row)
        covariances.append([float(row.pop(at)) for row in rows if row[0].isdigit()])
        others.append(rows)
    assert len(covariances[0]) > 100
    assert others[0] == others[1]
    np.testing.assert_allclose(*covariances, atol=1e-6 + 0.0005 * 0.1**2, rtol=0.0)


@pytest.mark.full
def test_a_kept_run_is_shown_as_it_was_and_nothing_is_computed(kept: TestClient) -> None:
    before = kept.get("/api/export/tracks.csv").text
    steps = [kept.get(f"/api/step/{step}").json() for step in (10, 60, 119)]
    changed, default = runs_of(kept)
    kept.post(f"/api/library/runs/{default['id']}/open")
    state = kept.post(f"/api/library/runs/{changed['id']}/open").json()
    assert (state["run"]["state"], state["run"]["kept"]) == ("done", changed["id"])
    assert state["parameters"][P_D] == 0.8
    assert_same_tracks(kept.get("/api/export/tracks.csv").text, before)
    for then in steps:
        now = kept.get(f"/api/step/{then['step']}").json()
        assert [t["position"] for t in now["tracks"]] == [t["position"] for t in then["tracks"]]
        for camera_then, camera in zip(then["cameras"], now["cameras"], strict=True):
            assert [t["box"] for t in camera["tracks"]] == [t["box"] for t in camera_then["tracks"]]
            for a, b in zip(camera_then["tracks"], camera["tracks"], strict=True):
                probabilities = (a["detection_probability"], b["detection_probability"])
                assert probabilities[0] == pytest.approx(probabilities[1], abs=1e-3)
        # only its tracks were stored: nothing is made up of what the filter and the cameras had
        assert now["cameras"][0]["measurements"] == []
        assert (now["components"], now["cardinality"]) == (None, None)
    wait_until(is_evaluated(kept))
    assert len(runs_of(kept)) == 2  # it is not kept again


@pytest.mark.full
def test_of_a_kept_run_nothing_is_made_up_of_what_was_not_stored(kept: TestClient) -> None:
    before = kept.get("/api/timeline").json()
    track = kept.get("/api/step/60").json()["tracks"][0]["id"]
    detected = kept.get(f"/api/courses/{track}?kind=detection").json()
    kept.post(f"/api/library/runs/{runs_of(kept)[0]['id']}/open")
    timeline = kept.get("/api/timeline").json()
    assert timeline["count"] == before["count"]
    assert timeline["cardinality"]["mean"] == timeline["deviation"]["mean"] == []
    assert kept.get(f"/api/courses/{track}?kind=detection").json() == detected
    for page in ("step/60", "changes", "runs", "corrections/queue"):
        assert kept.get(f"/api/{page}").status_code == 200, page
    refused = kept.post("/api/identity")
    assert refused.status_code == 409
    assert "boxes of the cameras were not kept" in refused.json()["detail"]


@pytest.mark.full
def test_what_the_cameras_found_comes_back_by_computing_again(kept: TestClient) -> None:
    changed, _ = runs_of(kept)
    kept.post(f"/api/library/runs/{changed['id']}/open")
    state = kept.post("/api/run").json()
    assert state["run"]["kept"] is None
    wait_until(run_is(kept, "done"))
    assert kept.get("/api/step/60").json()["cameras"][0]["measurements"] != []


@pytest.mark.full
def test_a_moved_slider_computes_on_from_a_kept_run(kept: TestClient) -> None:
    kept.post(f"/api/library/runs/{runs_of(kept)[1]['id']}/open")
    state = command(kept, "set_parameters", changes={P_D: 0.7}).json()
    assert state["run"]["kept"] is None
    wait_until(run_is(kept, "done"))
    wait_until(lambda: len(runs_of(kept)) == 3)


@pytest.mark.full
def test_a_run_of_older_code_says_so_and_is_another_than_a_computation(
    kept: TestClient, path: Path
) -> None:
    number = runs_of(kept)[1]["id"]
    with Library(path) as library:
        library._connection.execute(
            "UPDATE runs SET code = 'old', key = 'old' WHERE id = ?", (number,)
        )
    assert runs_of(kept)[1]["older_code"]
    shown = kept.post(f"/api/library/runs/{number}/open").json()["run"]
    assert shown["stands_for"] != ""
    assert shown["key"] != shown["stands_for"]
    again = kept.post("/api/run").json()["run"]
    assert (again["key"], again["kept"]) == (shown["stands_for"], None)


@pytest.mark.full
def test_a_run_of_another_recording_opens_it_first(kept: TestClient, data: Path) -> None:
    number = runs_of(kept)[0]["id"]
    kept.post("/api/sequence", json={"name": "numbers"})
    wait_until(lambda: kept.get("/api/state").json()["sequence"]["name"] == "numbers")
    kept.post(f"/api/library/runs/{number}/open")
    wait_until(lambda: kept.get("/api/state").json()["run"]["kept"] == number)
    assert kept.get("/api/state").json()["sequence"]["name"] == "crossing"
    assert kept.get("/api/step/60").json()["tracks"] != []


@pytest.mark.full
def test_a_kept_run_is_pinned_beside_the_shown_one(kept: TestClient) -> None:
    state = kept.post(f"/api/library/runs/{runs_of(kept)[1]['id']}/pin").json()
    assert state["pinned"]["differs"] == [P_D]
    wait_until(lambda: kept.get("/api/evaluation/comparison").status_code == 200)
    comparison = kept.get("/api/evaluation/comparison").json()
    assert comparison["against"] == "pinned"


def test_a_run_that_cannot_be_pinned_says_why(data: Path, path: Path, tmp_path: Path) -> None:
    gone, there = tmp_path / "gone", data / "numbers"
    of_gone = replace(record_of_recording(read_sequence(there), ""), place=str(gone))
    with Library(path) as library:
        library.keep(of_gone, made(1))
        library.keep(replace(of_gone, place=str(there)), made(2, kept=tracks(9, 2, cameras=7)))
    with application(data, path, str(there)) as client:
        answer = client.post("/api/library/runs/1/pin")
        assert answer.status_code == 422
        assert answer.json()["detail"] == f"There is no sequence.toml in {gone} any more."
        assert answer.json()["hint"].lower() == f"{WHERE_NOW}.".lower()
        answer = client.post("/api/library/runs/2/pin")
        assert "of 7 cameras, and numbers has" in answer.json()["detail"]
        # of what cannot be opened the page hears by another way
        assert answer.json()["code"] != "cannot_open"


@pytest.mark.full
def test_names_stars_notes_and_deletion(kept: TestClient) -> None:
    number = runs_of(kept)[0]["id"]
    marks = {"star": True, "note": "as it comes", "tags": ["paper"]}
    assert command(kept, "mark_run", run=number, title="baseline", **marks).status_code == 204
    wish = {"name": "baseline", **marks}
    assert {key: runs_of(kept)[0][key] for key in wish} == wish
    gone = command(kept, "delete_runs", runs=[number]).json()
    assert gone["bytes"] > 0
    assert len(runs_of(kept)) == 1
    told = command(kept, "undo").json()
    assert runs_of(kept)[0]["name"] == "baseline"
    assert told["edits"]["redo"] == f"run {number} deleted"
    assert command(kept, "undo").json()["marks"] > told["marks"]
    assert {key: runs_of(kept)[0][key] for key in wish} == {
        "name": "", "star": False, "note": "", "tags": []
    }  # fmt: skip
    answer = command(kept, "delete_runs", runs=[999])
    assert answer.status_code == 404
    assert "no run 999" in answer.json()["detail"]


@pytest.mark.full
def test_the_preview_has_what_is_drawn(kept: TestClient) -> None:
    number = runs_of(kept)[0]["id"]
    told = kept.get(f"/api/library/runs/{number}").json()
    assert told["frames"] == 120
    assert {track["id"] for track in told["tracks"]} == {c["id"] for c in told["courses"]}
    assert max(told["people"]) == 2.0
    assert told["people_every"] * len(told["people"]) == 120
    assert told["room"] == kept.get("/api/state").json()["sequence"]["room"]
    step = kept.get("/api/step/60").json()
    firsts = {c["id"]: np.array(c["points"]) for c in told["courses"]}
    for track in step["tracks"]:
        ways = firsts[track["id"]] - np.array(track["position"][:2])
        assert np.hypot(*ways.T).min() < 0.3


@pytest.mark.full
def test_runs_stay_when_the_recording_is_gone(kept: TestClient, data: Path, path: Path) -> None:
    with Library(path) as library:
        library._connection.execute("UPDATE recordings SET place = place || '-gone'")
    number = runs_of(kept)[0]["id"]
    told = kept.get("/api/library").json()["recordings"]
    assert any(r["missing"] and "any more" in r["missing"] for r in told)
    answer = kept.post(f"/api/library/runs/{number}/open")
    assert answer.status_code == 422
    assert kept.get(f"/api/library/runs/{number}").status_code == 200
    for form, state in (("csv", "done"), ("html", "failed")):
        assert kept.post("/api/exports", json={"format": form, "run": number}).status_code == 200
        wait_until(lambda: kept.get("/api/exports").json()["state"] != "writing")
        assert kept.get("/api/exports").json()["state"] == state
    assert "under Find…" in kept.get("/api/exports").json()["error"]


def test_a_damaged_library_is_told_and_the_workbench_goes_on(data: Path, path: Path) -> None:
    path.write_bytes(b"not a database " * 100)
    with application(data, path) as client:
        wait_until(run_is(client, "done"))
        told = client.get("/api/library").json()
        assert "damaged" in told["error"]
        assert any(r["name"] == "numbers" for r in told["recordings"])
        answer = client.get("/api/library/runs/1")
        assert answer.status_code == 409
        assert "damaged" in answer.json()["detail"]
    assert path.read_bytes() == b"not a database " * 100


def test_a_workbench_without_a_library_keeps_nothing(client: TestClient) -> None:
    told = client.get("/api/library").json()
    assert "without a library" in told["error"]


def test_provisional_figures_are_marked_and_made_anew_when_their_run_is_opened(
    data: Path, path: Path
) -> None:
    with application(data, path) as client:
        wait_until(lambda: len(runs_of(client)) == 1)
        (true,) = runs_of(client)
        ospa = client.get(f"/api/library/runs/{true['id']}").json()["ospa"]
    with Library(path) as library:
        library.score(true["id"], {"mota": 0.25, "misses": 77}, [0.5] * 50)
    made_by_the_version_before(path)
    with application(data, path, "numbers") as client:
        (before,) = runs_of(client)
        assert (before["provisional"], before["mota"]) == (True, 0.25)
        small = client.get(f"/api/library/runs/{true['id']}").json()
        assert small["ospa"] == []
        assert small["room"] is None, "another recording is open"
        client.post(f"/api/library/runs/{true['id']}/open")
        wait_until(lambda: not runs_of(client)[0]["provisional"])
        assert runs_of(client) == [{**true, "templates": None}], "its file did not tell them"
        small = client.get(f"/api/library/runs/{true['id']}").json()
        assert small["ospa"] == ospa
