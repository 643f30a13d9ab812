"""The routes of corrections: said, obeyed, taken back, kept over a start."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from starlette.testclient import TestClient

from app.state.correcting import Doubting
from app.web.dependencies import Settings
from app.web.server import create_app
from tests.app.conftest import ADDRESS, Runs, command, connect, run_is, wait_until
from tracker.corrections import Correction
from tracker.corrections.log import own_place, read_log, write_log
from tracker.review.queue import Alternative, Queue, ReviewItem
from tracker.review.queue.item import TrackRows, propose
from tracker.sequences.reader import WHERE_NOW, read_sequence

PLACE = "/api/corrections"


@pytest.fixture
def own(data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the recording with boxes, which may be written to, and settings of its own."""
    monkeypatch.setenv("MULTIVIEW_PHD_SETTINGS", str(tmp_path / "settings"))
    folder = tmp_path / "crossing"
    shutil.copytree(data / "crossing", folder)
    return folder


@pytest.fixture
def desk(own: Path) -> Iterator[TestClient]:
    """The application with it open and computed."""
    with started(own) as client:
        yield client


def started(folder: Path) -> Any:
    """A start of the application, which keeps what can be taken back."""
    app = create_app(Settings(sequence=str(folder), with_viser=False, keep_on_disk=True))

    class Start:
        def __enter__(self) -> TestClient:
            self.client = TestClient(app, base_url=ADDRESS)
            self.client.__enter__()
            wait_until(run_is(self.client, "done"))
            return self.client

        def __exit__(self, *error: object) -> None:
            self.client.__exit__(None, None, None)

    return Start()


def tracks(client: TestClient) -> list[dict[str, Any]]:
    """The lives of the shown run."""
    lives: list[dict[str, Any]] = client.get("/api/timeline").json()["tracks"]
    return lives


def settled(client: TestClient) -> dict[str, Any]:
    """The corrections, once the run has met them or not."""
    answer: dict[str, Any] = {}

    def holds() -> bool:
        answer.update(client.get(PLACE).json())
        return run_is(client, "done")() and all(
            one["met"] is not None for one in answer["corrections"]
        )

    wait_until(holds)
    return answer


def test_in_a_folder_that_is_gone_nothing_is_corrected_and_nothing_is_lost(
    desk: TestClient, own: Path
) -> None:
    one = max(tracks(desk), key=lambda life: life["last"] - life["first"])
    wish = {"kind": "name", "step": one["first"] + 9, "tracks": [one["id"]], "name": "Anna"}
    assert command(desk, "correct", corrections=[wish]).status_code == 204
    before = desk.get(PLACE).json()["corrections"]
    assert len(before) == 1
    elsewhere = own.with_name("elsewhere")
    own.rename(elsewhere)
    assert [c["id"] for c in desk.get(PLACE).json()["corrections"]] == [before[0]["id"]]
    for name, fields in (
        ("correct", {"corrections": [wish | {"name": "Bo"}]}),
        ("undo", {}),
        ("save_taught", {}),
    ):
        answer = command(desk, name, **fields)
        assert answer.status_code in (409, 422), name
        assert f"here is no sequence.toml in {own} any more; {WHERE_NOW}" in answer.json()["detail"]
    assert [c["id"] for c in desk.get(PLACE).json()["corrections"]] == [before[0]["id"]]
    assert not own_place(own).exists()
    assert not own.exists()
    elsewhere.rename(own)
    wish["name"] = "Bo"
    assert command(desk, "correct", corrections=[wish]).status_code == 204
    assert [c.name for c in read_log(own / "corrections.toml")] == ["Anna", "Bo"]


@pytest.mark.full
def test_a_cut_is_obeyed_kept_taken_back_and_said_again(desk: TestClient, own: Path) -> None:
    before = tracks(desk)
    one = max(before, key=lambda life: life["last"] - life["first"])
    step = (one["first"] + one["last"]) // 2
    wish = {"kind": "different", "step": step, "tracks": [one["id"]]}
    answer = command(desk, "correct", corrections=[wish], note="two people")
    assert answer.status_code == 204, answer.text
    found = settled(desk)
    assert [c["met"] for c in found["corrections"]] == [True]
    assert found["corrections"][0]["note"] == "two people"
    said = desk.get("/api/state").json()["edits"]
    assert said["undo"] == found["corrections"][0]["words"]
    assert len(tracks(desk)) == len(before) + 1
    assert [c.kind for c in read_log(own / "corrections.toml")] == ["different"]
    command(desk, "undo")
    assert settled(desk)["corrections"] == []
    assert len(tracks(desk)) == len(before)
    assert read_log(own / "corrections.toml") == ()
    command(desk, "redo")
    again = desk.get(PLACE).json()
    assert again["corrections"][0]["id"] == found["corrections"][0]["id"]
    settled(desk)
    assert len(tracks(desk)) == len(before) + 1
    assert command(desk, "redo").status_code == 409
    key = desk.get("/api/state").json()["corrections"]
    assert (key["count"], key["unmet"]) == (1, 0)


@pytest.mark.full
def test_what_can_be_taken_back_survives_a_start(own: Path) -> None:
    with started(own) as client:
        lives = tracks(client)
        wish = {"kind": "name", "tracks": [lives[0]["id"]], "name": "Anna", "step": 30}
        command(client, "correct", corrections=[wish])
        command(client, "correct", corrections=[{"kind": "checked", "first": 0, "last": 9}])
        command(client, "undo")
    with started(own) as client:
        found = settled(client)
        assert found["names"] == {str(lives[0]["id"]): "Anna"}
        told = command(client, "redo").json()
        assert told["edits"] == {"undo": "steps 0 – 9 checked", "redo": None}
        assert client.get(PLACE).json()["checked"] == [[0, 9]]
        command(client, "undo")
        command(client, "undo")
        assert client.get(PLACE).json()["corrections"] == []
        assert command(client, "undo").status_code == 409


@pytest.mark.full
def test_what_a_full_disk_kept_elsewhere_is_there_after_a_start_and_goes_back(
    own: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    wishes = [{"kind": "checked", "first": first, "last": first} for first in (2, 20, 40)]
    log = own / "corrections.toml"
    full_places = {log}

    def full(path: Path, corrections: Iterable[Correction]) -> None:
        if path in full_places:
            raise OSError(f"{path}: cannot be written (No space left on device)")
        write_log(path, corrections)

    with started(own) as client:
        command(client, "correct", corrections=wishes[:1])
        with monkeypatch.context() as patched:
            patched.setattr("app.state.correcting.write_log", full)
            assert command(client, "correct", corrections=wishes[1:2]).status_code == 204
            full_places.add(own_place(own))
            full_there = command(client, "correct", corrections=wishes[2:])
            assert full_there.status_code == 422
            assert full_there.json()["detail"].endswith("(No space left on device).")
        assert len(read_log(log)) == 1
    with started(own) as client:
        assert client.get(PLACE).json()["checked"] == [[2, 2], [20, 20]]
        command(client, "correct", corrections=wishes[2:])
        assert client.get(PLACE).json()["checked"] == [[2, 2], [20, 20], [40, 40]]
    assert len(read_log(log)) == 3
    assert not own_place(own).exists()


@pytest.mark.full
def test_what_cannot_be_is_refused_with_a_sentence(desk: TestClient, own: Path) -> None:
    lives = tracks(desk)
    two = [life["id"] for life in lives[:2]]
    for wish, words in (
        ({"kind": "different", "step": 40, "tracks": [999]}, "no track 999"),
        ({"kind": "exchanged", "step": 40, "tracks": two[:1]}, "found 1"),
        ({"kind": "here", "step": 40, "clicks": [{"camera": "x", "x": 1, "y": 1}]}, "no camera x"),
        ({"kind": "here", "step": 40, "place": [90.0, 0.0, 1.0]}, "outside the room"),
        ({"kind": "checked", "first": 9, "last": 3}, "expected a step from 9 on"),
        ({"kind": "different", "step": 10**6, "tracks": two[:1]}, "expected 0 …"),
    ):
        answer = command(desk, "correct", corrections=[wish])
        assert answer.status_code == 422, wish
        assert words in answer.json()["detail"], answer.text
    assert not (own / "corrections.toml").exists()
    assert command(desk, "drop_correction", id="nothing").status_code == 422


def test_a_malformed_log_is_told_and_the_recording_stays_usable(own: Path) -> None:
    (own / "corrections.toml").write_text('format = 1\n\n[[correction]]\nkind = "hier"\n')
    with started(own) as client:
        found = client.get(PLACE).json()
        assert "line 4" in found["problem"]
        with connect(client) as socket:
            told = socket.receive_json()
        assert told["type"] == "notice"
        assert "line 4" in told["message"]
        assert tracks(client)
        answer = command(
            client, "correct", corrections=[{"kind": "checked", "first": 0, "last": 9}]
        )
        assert answer.status_code == 422
        assert "line 4" in answer.json()["detail"]
    assert "hier" in (own / "corrections.toml").read_text()


def test_a_log_that_another_program_writes_is_read_again(own: Path) -> None:
    log = own / "corrections.toml"
    checked = {"kind": "checked", "first": 0, "last": 9}
    with started(own) as client:
        command(client, "correct", corrections=[checked])
        theirs = log.read_text().replace("last = 9", "last = 7")
        log.write_text(theirs)
        # without a look at it before: nothing of it is lost
        command(client, "correct", corrections=[{**checked, "first": 20, "last": 30}])
        found = client.get(PLACE).json()
        assert [one["last"] for one in found["corrections"]] == [7, 30]
        assert [one.last for one in read_log(log)] == [7, 30]
        log.write_text("[[correction]]")
        assert "corrections.toml" in client.get(PLACE).json()["problem"]
        answer = command(client, "correct", corrections=[checked])
        assert answer.status_code == 422
        assert log.read_text() == "[[correction]]"
        log.write_text(theirs)
        found = client.get(PLACE).json()
        assert found["problem"] is None
        assert [one["last"] for one in found["corrections"]] == [7]
        # what was done before cannot be put back: it is not what the file has
        assert client.get("/api/state").json()["edits"]["undo"] is None


def raise_doubts(desk: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is hardly doubtful is asked, too: who passes metres apart."""
    monkeypatch.setattr("tracker.review.queue.ranking.LEAST", 0.0)
    monkeypatch.setattr("tracker.review.queue.meetings._CLOSE", 8.0)
    command(desk, "set_parameters", changes={"fusion.survival_probability": 0.97})
    settled(desk)


@pytest.mark.full
def test_the_queue_is_answered_previewed_and_skipped(
    desk: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert desk.get(f"{PLACE}/queue").json()["doubts"] == [], "all is clear here"
    raise_doubts(desk, monkeypatch)
    queue = desk.get(f"{PLACE}/queue").json()
    assert queue["complete"]
    assert queue["doubts"], queue
    weights = [one["doubt"] * one["stake"] for one in queue["doubts"]]
    assert weights == sorted(weights, reverse=True)
    first = queue["doubts"][0]
    assert [a["as_it_is"] for a in first["alternatives"]][:2] == [True, False]
    shown = desk.get(f"{PLACE}/queue/{first['id']}/1").json()
    assert shown["tracks"]
    assert desk.get(f"{PLACE}/queue/{first['id']}/0").json()["spans"] == []
    assert desk.get(f"{PLACE}/queue/{first['id']}/99").status_code == 404
    assert desk.get(f"{PLACE}/queue/nothing/0").status_code == 404
    command(desk, "skip", doubt=first["id"])
    left = desk.get(f"{PLACE}/queue").json()["doubts"]
    assert first["id"] not in [one["id"] for one in left]
    if len(left):
        answer = command(desk, "answer", doubt=left[0]["id"], alternative=0)
        assert answer.status_code == 204, answer.text
        settled(desk)
        rest = desk.get(f"{PLACE}/queue").json()["doubts"]
        assert left[0]["id"] not in [one["id"] for one in rest]


def test_how_it_would_be_is_shown_until_it_is_no_more(
    desk: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    lanes = TrackRows(desk.app.state.workbench.snapshot().run.tracks)  # type: ignore[attr-defined]
    track = tracks(desk)[0]["id"]
    places = (lanes.place(track, 59), lanes.place(track, 60, after=True))
    two = Alternative("two people", 0.5, propose("different", places))
    made = ReviewItem(
        "cut", "two people?", "told", 59, 60, (track,), places, 0.5, 60,
        (Alternative("as it is", 0.5, ()), two),
    )  # fmt: skip
    monkeypatch.setattr(Doubting, "of", lambda self, snapshot: Queue((made,), 0, "a test"))
    first = desk.get(f"{PLACE}/queue").json()["doubts"][0]
    told = desk.post(f"{PLACE}/ghosts", json={"doubt": first["id"], "alternative": 1}).json()
    assert told == desk.get(f"{PLACE}/queue/{first['id']}/1").json()
    assert [one["was"] for one in told["spans"]] == [track]
    ghosts = desk.app.state.workbench.snapshot().ghosts  # type: ignore[attr-defined]
    assert set(ghosts.tracks.ids.tolist()) == {one["id"] for one in told["tracks"]}
    assert ghosts.run == desk.get("/api/state").json()["run"]["key"]
    assert desk.post(f"{PLACE}/ghosts", json={"doubt": "nothing"}).status_code == 404
    assert desk.post(f"{PLACE}/ghosts", json={"doubt": None}).json()["tracks"] == []
    assert desk.app.state.workbench.snapshot().ghosts is None  # type: ignore[attr-defined]


@pytest.mark.full
def test_what_is_answered_of_the_run_before_counts_in_the_one_that_came_meanwhile(
    desk: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    lanes = TrackRows(desk.app.state.workbench.snapshot().run.tracks)  # type: ignore[attr-defined]
    track = tracks(desk)[0]["id"]
    places = (lanes.place(track, 59), lanes.place(track, 60, after=True))
    now = Alternative("as it is", 0.5, propose("same", places))
    two = Alternative("two people", 0.5, propose("different", places))
    made = ReviewItem(
        "cut", "two people?", "told", 59, 60, (track,), places, 0.5, 60, (now, two)
    )  # fmt: skip
    queues = iter([Queue((made,), 0, "a test")])
    nothing = Queue((), 0, "a test")
    monkeypatch.setattr(
        "app.state.correcting.queue", lambda run, corrections: next(queues, nothing)
    )
    command(desk, "set_parameters", changes={"fusion.survival_probability": 0.97})
    settled(desk)
    (shown,) = desk.get(f"{PLACE}/queue").json()["doubts"]
    command(desk, "set_parameters", changes={"fusion.survival_probability": 0.98})
    settled(desk)
    assert desk.get(f"{PLACE}/queue").json()["doubts"] == []
    assert desk.get(f"{PLACE}/queue/{shown['id']}/1").status_code == 404, "of other tracks"
    answer = command(desk, "answer", doubt=shown["id"], alternative=1)
    assert answer.status_code == 204, answer.text
    assert [one["kind"] for one in settled(desk)["corrections"]] == ["different"]


@pytest.mark.full
def test_what_is_checked_leaves_the_queue_though_the_run_stays_the_same(
    desk: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    raise_doubts(desk, monkeypatch)
    first, last = 0, desk.app.state.workbench.snapshot().sequence.frames - 1  # type: ignore[attr-defined]
    assert desk.get(f"{PLACE}/queue").json()["doubts"] != []
    wish = {"kind": "checked", "first": first, "last": last}
    command(desk, "correct", corrections=[wish])
    (told,) = desk.get(PLACE).json()["corrections"]
    assert told["met"] is True
    assert desk.get(f"{PLACE}/queue").json()["doubts"] == []
    command(desk, "undo")
    assert desk.get(f"{PLACE}/queue").json()["doubts"] != []


@pytest.mark.full
def test_an_answer_that_is_taken_back_is_no_answer_before_the_run_is_another(
    desk: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    raise_doubts(desk, monkeypatch)
    before = desk.get(f"{PLACE}/queue").json()
    command(desk, "answer", doubt=before["doubts"][0]["id"], alternative=0)
    settled(desk)
    told = desk.get(f"{PLACE}/queue").json()
    assert told["answered"] > before["answered"]
    now = desk.app.state.workbench.snapshot()  # type: ignore[attr-defined]
    assert now.run.corrections
    assert Doubting().of(now).answered == told["answered"]
    assert Doubting().of(replace(now, corrections=())).answered == before["answered"]


@pytest.mark.full
def test_a_name_that_is_dropped_is_gone_before_the_run_is_another(desk: TestClient) -> None:
    wish = {"kind": "name", "tracks": [tracks(desk)[0]["id"]], "name": "Anna", "step": 30}
    command(desk, "correct", corrections=[wish])
    (one,) = settled(desk)["corrections"]
    assert tracks(desk)[0]["name"] == "Anna"
    answer = command(desk, "drop_correction", id=one["id"])
    assert answer.status_code == 204, answer.text
    assert desk.get(PLACE).json()["names"] == {}


@pytest.mark.full
def test_the_feet_of_a_track_that_goes_over_the_floor_stay_where_they_are(own: Path) -> None:
    # as heads do; here the floor is sunk below people
    file, sequence = own / "sequence.toml", read_sequence(own)
    text, found = re.subn(r"(?m)^min = \[(.*), .*\]", r"min = [\1, -1.0]", file.read_text())
    assert found == 1
    file.write_text(text)
    with started(own) as desk:
        life = tracks(desk)[0]
        step = (life["first"] + life["last"]) // 2
        told = desk.get(f"/api/step/{step}?trails=true").json()
        (track,) = [one for one in told["tracks"] if one["id"] == life["id"]]
        camera = sequence.cameras[0]
        ((x, y),), _ = camera.project(
            np.array([track["position"]]) - [0.0, 0.0, sequence.target_half_extents[2]]
        )
        wish = {
            "kind": "here",
            "step": step,
            "tracks": [life["id"]],
            "clicks": [{"camera": camera.name, "x": float(x), "y": float(y)}],
        }
        command(desk, "correct", corrections=[wish])
        (told,) = desk.get(PLACE).json()["corrections"]
    assert told["places"][0] == pytest.approx([step, *track["position"]], abs=0.02)


@pytest.mark.full
def test_only_what_was_checked_counts_as_truth(desk: TestClient, own: Path, run: Runs) -> None:
    assert desk.get(f"{PLACE}/truth.csv").status_code == 422
    wish = [
        {"kind": "checked", "first": 10, "last": 19},
        {"kind": "checked", "first": 20, "last": 29},
    ]
    command(desk, "correct", corrections=wish)
    found = desk.get(PLACE).json()
    assert found["checked"] == [[10, 29]]
    text = desk.get(f"{PLACE}/truth.csv").text
    assert text.startswith("# steps = 10-29\nframe,id,x,y,z\n")
    truth = own / "truth.csv"
    truth.write_text(text)
    out = own / "tracks.csv"
    assert run("track", str(own), "-o", str(out), "--keep", "0")[0] == 0
    status, told, _ = run("evaluate", str(own), str(out), "--truth", str(truth), "--json")
    assert status == 0
    answer = json.loads(told)
    figures = {one["key"]: one["value"] for one in answer["figures"]}
    assert figures["idf1"] == pytest.approx(1.0)
    assert sum(answer["series"]["truth"][:10]) == 0
    assert sum(answer["series"]["estimates"][30:]) == 0
    assert any("truth says nothing" in note for note in answer["notes"])


def test_who_may_be_missing_is_shown_where_each_camera_would_have_him(
    desk: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = desk.app.state.workbench.snapshot().run  # type: ignore[attr-defined]
    place = TrackRows(run.tracks).place(tracks(desk)[0]["id"], 60)
    other = place._replace(step=70)
    here = (*propose("here", (place,)), *propose("here", (other,)))
    made = ReviewItem(
        "missing", "Somebody is missing?", "told", 60, 70, (), (place, other), 0.7, 11,
        (Alternative("nobody", 0.3, propose("nobody", (place, other))),
         Alternative("somebody", 0.7, here)),
    )  # fmt: skip
    monkeypatch.setattr(Doubting, "of", lambda self, snapshot: Queue((made,), 0, "a test"))
    (told,) = desk.get(f"{PLACE}/queue").json()["doubts"]
    assert told["tracks"] == []
    assert {(one["step"], one["camera"]) for one in told["sights"]} == {
        (step, camera) for step in (60, 70) for camera in range(len(run.sequence.cameras))
    }
    boxes, _ = run.sequence.cameras[0].project_boxes(
        place.point[None], run.sequence.target_half_extents
    )
    first = next(one for one in told["sights"] if (one["step"], one["camera"]) == (60, 0))
    assert first["box"] == pytest.approx(boxes[0])
    assert desk.get(f"{PLACE}/queue/{told['id']}/1").status_code == 200
    command(desk, "answer", doubt=told["id"], alternative=1)
    assert [one["kind"] for one in desk.get(PLACE).json()["corrections"]] == ["here", "here"]
