"""From files that a page sends, or a folder on the disk, to an open recording."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient

from app.web.dependencies import Settings
from app.web.server import create_app
from tests.app.conftest import ADDRESS, run_is, wait_until
from tests.io.importing.test_angles import lay_out
from tests.io.read.recorded import PLACES, detections, settled_of, toml, videos
from tracker.io.checks.truth import check_truth
from tracker.io.importing import writing
from tracker.io.importing.writing import write
from tracker.runs.pipeline import Cancelled
from tracker.sequences.reader import read_sequence

PIECE = 4096


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """An empty folder of recordings."""
    folder = tmp_path / "data"
    folder.mkdir()
    return folder


@pytest.fixture
def client(data: Path) -> Iterator[TestClient]:
    """A workbench with nothing open."""
    app = create_app(Settings(data=data, with_viser=False))
    with TestClient(app, base_url=ADDRESS) as client:
        yield client


@pytest.fixture
def files(tmp_path: Path) -> Path:
    """A recording as other programs leave it: Anipose's calibration and boxes."""
    folder = tmp_path / "session"
    folder.mkdir()
    toml(folder)
    detections(folder)
    (folder / "notes.txt").write_text("the door was open\n")
    return folder


def _send(client: TestClient, folder: Path) -> str:
    paths = sorted(path for path in folder.rglob("*") if path.is_file())
    announced = [
        {"path": path.relative_to(folder.parent).as_posix(), "bytes": path.stat().st_size}
        for path in paths
    ]
    begun = client.post("/api/import", json={"files": announced}).json()["draft"]
    for number, path in enumerate(paths):
        content = path.read_bytes()
        for offset in range(0, len(content), PIECE):
            address = f"/api/import/{begun['key']}/files/{number}?offset={offset}"
            answer = client.put(address, content=content[offset : offset + PIECE])
            assert answer.status_code == 204, answer.text
    assert client.post(f"/api/import/{begun['key']}/arrived").status_code == 200
    return begun["key"]


def _settled(client: TestClient, key: str) -> dict[str, Any]:
    deadline = time.monotonic() + 60.0
    while True:
        info: dict[str, Any] = client.get(f"/api/import/{key}").json()
        if not info["busy"] and info["phase"] != "reading":
            return info
        assert time.monotonic() < deadline
        time.sleep(0.02)


def _wish(client: TestClient, info: dict[str, Any], **changes: Any) -> dict[str, Any]:
    address = f"/api/import/{info['key']}/wish"
    answer = client.put(address, json={**info["wish"], **changes})
    assert answer.status_code == 200, answer.text
    return _settled(client, info["key"])


def test_files_that_are_sent_become_a_recording(
    client: TestClient, files: Path, data: Path
) -> None:
    info = _settled(client, _send(client, files))
    assert info["phase"] == "settled"
    assert info["wish"]["name"] == "session"
    assert [camera["name"] for camera in info["cameras"]] == ["cam1", "cam2", "cam3", "cam4"]
    assert info["cameras"][0]["detections"] == "cam1.csv"
    (unused,) = (one for one in info["files"] if not one["used"])
    assert (unused["label"], unused["why"]) == ("session/notes.txt", "no format that is read")
    assert (info["files_used"], info["files_there"]) == (5, 6)
    assert {one["status"] for one in info["checks"]} == {"good", "absent"}
    (absent,) = (one for one in info["checks"] if one["status"] == "absent")
    assert absent["sentence"] == "there is no truth"
    assert len(info["pairs"]) == 6
    assert not any(pair["odd"] for pair in info["pairs"])
    plan = info["plan"]
    assert len(plan["seen"]) == plan["width"] * plan["height"]
    assert max(plan["seen"]) == 4
    assert plan["feet"]
    info = _wish(client, info, name="living room")
    client.post(f"/api/import/{info['key']}/write", json={"open": True})
    wait_until(lambda: client.get("/api/state").json()["sequence"] is not None)
    assert client.get("/api/state").json()["sequence"]["name"] == "living room"
    assert (data / "living room/files/session/cam1.csv").is_file()
    assert sorted(path.name for path in data.iterdir()) == ["living room"]

    def last() -> tuple[str, str, int]:
        card = client.get("/api/recordings").json()["recordings"][0]
        return card["name"], card["kind"], card["cameras"]

    wait_until(lambda: last() == ("living room", "recent", 4))


@pytest.mark.full
def test_a_wish_is_looked_into_and_can_be_taken_back(client: TestClient, files: Path) -> None:
    info = _settled(client, _send(client, files))
    other = _wish(client, info, pose="camera-to-world")
    assert other["undecided"].startswith("with “Poses” camera-to-world ")
    assert "poses world-to-camera" in other["undecided"]
    refused = client.post(f"/api/import/{info['key']}/write", json={})
    assert refused.status_code == 422
    assert "without it" in refused.text
    mend = next(one["mend"] for one in other["checks"] if one["mend"])
    assert mend["pose"] == "world-to-camera"
    assert _wish(client, other, accept_best=True)["undecided"] == ""
    assert _wish(client, other, **mend)["checks"] == info["checks"]
    late = _wish(client, info, offsets={"cam2": -0.2})
    assert late["cameras"][1]["offset"]["steps"] == pytest.approx(-0.2 * info["fps"], abs=1.0)
    room = [[-2.0, -2.0, 0.0], [2.0, 2.0, 2.0]]
    small = _wish(client, info, room=room, left_out=["cam4"], half_extents=[0.2, 0.2, 0.8])
    assert small["room"] == room
    assert small["suggested"] != room
    assert small["half_extents"] == [0.2, 0.2, 0.8]
    assert len(small["cameras"]) == 3
    wrong = _wish(client, info, names={"cam1": "cam2"})
    assert (wrong["phase"], 'found "cam2" twice' in wrong["error"]) == ("failed", True)
    assert _wish(client, info, names={})["phase"] == "settled"


@pytest.mark.full
def test_angles_of_which_nothing_tells_the_order_are_asked_for(
    client: TestClient, tmp_path: Path
) -> None:
    folder = tmp_path / "rig"
    folder.mkdir()
    lay_out(folder, "into the camera", seen=False)
    info = _settled(client, _send(client, folder))
    assert info["phase"] == "failed"
    assert "tell their order" in info["error"]
    assert ["zyx", "Rz Ry Rx"] in info["open_turns"]
    assert "xzy-inverse" in [name for name, _ in info["open_turns"]]
    info = _wish(client, info, turns="xzy-inverse", unit="m")
    assert (info["phase"], info["turns"]) == ("settled", "Rx Rz Ry, into the camera in radians")
    wrong = _wish(client, info, turns="sideways")
    assert (wrong["phase"], "expected “Angles”" in wrong["error"]) == ("failed", True)


def test_pictures_of_cameras_are_shown(client: TestClient, tmp_path: Path) -> None:
    folder = tmp_path / "filmed"
    folder.mkdir()
    toml(folder, size=(320, 180))
    videos(folder, size=(320, 180), frames=12)
    info = _settled(client, _send(client, folder))
    assert info["cameras"][0]["video"] == "cam1.avi"
    assert (info["cameras"][0]["frames"], info["cameras"][0]["fps"]) == (12, 20.0)
    address = f"/api/import/{info['key']}/picture"
    answer = client.get(address, params={"camera": "cam1"})
    assert answer.headers["content-type"] == "image/jpeg"
    assert client.get(address, params={"camera": "cam9"}).status_code == 404
    names = {one["name"]: one for one in info["checks"]}
    assert "only lenses, places of the cameras and motion" in names["boxes meet in 3D"]["sentence"]
    assert {"lenses", "cameras above the floor", "views overlap"} <= set(names)
    assert names["cameras hold still"]["status"] == "good"


@pytest.mark.full
def test_a_folder_of_the_disk_is_not_copied(client: TestClient, files: Path, data: Path) -> None:
    inside = files.rename(data / "walk")
    videos(inside, frames=60)
    assert client.get("/api/recordings").json()["folders"] == ["walk"]
    begun = client.post("/api/import/path", json={"path": "walk"}).json()["draft"]
    info = _settled(client, begun["key"])
    assert info["wish"]["name"] == "walk-2"
    client.post(f"/api/import/{info['key']}/write", json={"open": False})
    wait_until(lambda: (data / "walk-2").exists())
    video = data / "walk-2/cam1.avi"
    assert video.stat().st_ino == (inside / "cam1.avi").stat().st_ino
    assert client.get("/api/state").json()["sequence"] is None
    again = client.post("/api/import/path", json={"path": "walk-2/sequence.toml"}).json()
    assert again == {"draft": None, "first": 0, "recording": str(data / "walk-2")}


@pytest.mark.full
def test_a_folder_that_is_still_being_copied_is_waited_for(
    client: TestClient, files: Path, data: Path
) -> None:
    inside = files.rename(data / "walk")
    videos(inside, (128, 72), frames=60)
    video = inside / "cam2.avi"
    content = video.read_bytes()
    video.write_bytes(content[: len(content) // 2])
    begun = client.post("/api/import/path", json={"path": "walk"}).json()["draft"]
    address = f"/api/import/{begun['key']}"
    wait_until(lambda: "cam2.avi is not complete" in client.get(address).json()["under_way"])
    assert client.get(address).json()["phase"] == "reading"
    assert client.post(f"{address}/write", json={"open": False}).status_code == 422
    video.write_bytes(content)
    info = _settled(client, begun["key"])
    assert {camera["frames"] for camera in info["cameras"]} == {60}
    # and what comes after it was read is read, too, before anything is written
    video.write_bytes(content + b"more")
    answer = client.post(f"{address}/write", json={"open": False})
    assert answer.status_code == 422
    assert "cam2.avi came or was changed" in answer.text
    _settled(client, begun["key"])
    assert client.post(f"{address}/write", json={"open": False}).status_code == 200
    wait_until(lambda: (data / "walk-2").exists())


@pytest.mark.full
def test_entrances_and_methods_are_chosen_on_the_sheet(
    client: TestClient, files: Path, data: Path
) -> None:
    places = PLACES.copy()
    places[:25, 3] = 1e3  # the fourth comes in later
    detections(files, places=places)
    info = _settled(client, _send(client, files))
    assert info["fitting"]["single_view"] == "none"
    assert "has none; add a video" in info["unfit"]["single_view"]["jpda"]
    ((place, sigma),) = info["entrances"]
    assert place == pytest.approx(PLACES[25, 3].tolist(), abs=0.5)
    assert info["wish"]["entrances"] == []
    assert len(info["plan"]["entrances"]) == 1
    methods = {"single_view": None, "fusion_method": "sequential_phd"}
    chosen = _wish(client, info, entrances=[[place, sigma]], methods=methods)
    assert chosen["wish"]["entrances"] == [[place, sigma]]
    assert chosen["wish"]["methods"] == {"fusion_method": "sequential_phd"}
    wrong = _wish(client, info, methods={"single_view": "guessing"})
    answer = client.post(f"/api/import/{wrong['key']}/write", json={})
    assert "guessing" in answer.json()["detail"]
    chosen = _wish(client, info, entrances=[[place, sigma]], methods=methods)
    client.post(f"/api/import/{chosen['key']}/write", json={})

    def methods_now() -> dict[str, Any]:
        return client.get("/api/state").json()["methods"]

    wait_until(lambda: methods_now()["fusion_method"] == "sequential_phd")
    wait_until(run_is(client, "done"))
    state = client.get("/api/state").json()
    assert methods_now()["single_view"] == "none"
    assert state["sequence"]["room"]["entrances"] == [{"position": place, "sigma": sigma}]
    assert state["teaching"]["unsaved"] == 0


@pytest.mark.full
def test_a_recording_is_open_before_its_copies_are_there(
    client: TestClient, files: Path, data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    inside = files.rename(data / "walk")
    videos(inside, size=(320, 180), frames=60)
    held = threading.Event()
    copy = writing._copy

    def slowly(*arguments: Any) -> None:
        assert held.wait(60.0)
        copy(*arguments)

    monkeypatch.setattr(writing, "_copy", slowly)
    begun = client.post("/api/import/path", json={"path": "walk"}).json()["draft"]
    info = _wish(client, _settled(client, begun["key"]), copy_files=True)
    client.post(f"/api/import/{info['key']}/write", json={})
    wait_until(run_is(client, "done"))
    now = client.get(f"/api/import/{info['key']}").json()
    assert now["phase"] == "copying"
    key = client.get("/api/state").json()["sequence"]["key"]
    first, own = inside / "cam1.avi", data / "walk-2/cam1.avi"
    assert own.stat().st_ino == first.stat().st_ino
    held.set()
    wait_until(lambda: _settled(client, info["key"])["phase"] == "written")
    assert own.stat().st_ino != first.stat().st_ino
    assert own.read_bytes() == first.read_bytes()
    assert _settled(client, info["key"])["copied"] == sum(
        path.stat().st_size for path in inside.glob("*.avi")
    )
    # what is known of its content stays known
    client.post("/api/sequence", json={"name": str(data / "walk-2")})
    assert client.get("/api/state").json()["sequence"]["key"] == key


@pytest.mark.full
def test_copying_can_be_stopped(client: TestClient, files: Path, data: Path) -> None:
    inside = files.rename(data / "walk")
    videos(inside, size=(320, 180), frames=60)
    folder = data / "taken"
    settled = settled_of(inside)
    write(settled, folder, "taken")
    assert len(writing.links_in(folder)) == 4
    calls = []

    def stop(more: int) -> None:
        calls.append(more)
        if len(calls) == 2:
            raise Cancelled

    with pytest.raises(Cancelled):
        writing.copy_links(folder, stop)
    assert len(writing.links_in(folder)) == 3
    assert sorted(path.name for path in folder.glob("*.avi")) == [
        f"cam{k}.avi" for k in (1, 2, 3, 4)
    ]
    assert not list(folder.glob(".*"))
    assert read_sequence(folder).frames == 60


def test_truth_that_stands_elsewhere_is_told_as_the_check_tells_it(
    client: TestClient, files: Path, data: Path
) -> None:
    rows = "".join(f"{k},1,{90000 + 0.02 * k},90000,0.9\n" for k in range(60))
    (files / "ground_truth.csv").write_text(f"frame,id,x,y,z\n{rows}")
    info = _settled(client, _send(client, files))
    assert info["truth"] == 1
    (told,) = (one for one in info["checks"] if "truth's places" in one["sentence"])
    client.post(f"/api/import/{info['key']}/write", json={"open": True})
    wait_until(lambda: client.get("/api/state").json()["sequence"] is not None)
    wait_until(lambda: client.get("/api/evaluation").status_code == 200)
    found = check_truth(read_sequence(data / info["wish"]["name"]))
    assert (told["status"], told["sentence"]) == (found.status, found.sentence)
    assert found.status == "warning"
    assert f"{found.sentence}." in client.get("/api/evaluation").json()["notes"]


def test_a_path_may_be_anywhere_on_the_machine(client: TestClient, files: Path, data: Path) -> None:
    """As a recording's may, and as the command's: only a relative one is of the data folder."""
    assert not files.is_relative_to(data)
    begun = client.post("/api/import/path", json={"path": str(files)}).json()["draft"]
    info = _settled(client, begun["key"])
    assert (info["phase"], len(info["cameras"]), info["uploaded"]) == ("settled", 4, False)


@pytest.mark.full
def test_an_import_that_is_given_up_leaves_nothing(
    client: TestClient, files: Path, data: Path
) -> None:
    key = _send(client, files)
    assert client.delete(f"/api/import/{key}").status_code == 204
    answer = client.get(f"/api/import/{key}")
    assert (answer.status_code, answer.json()["code"]) == (404, "no_import")
    wait_until(lambda: not list(data.iterdir()))


@pytest.mark.full
def test_what_cannot_be_imported_is_told(client: TestClient, data: Path, tmp_path: Path) -> None:
    for nowhere in (str(tmp_path / "nowhere"), "nowhere"):
        answer = client.post("/api/import/path", json={"path": nowhere}).json()
        assert f"{nowhere}: there is no such file or folder" in answer["detail"]
    bad = client.post("/api/import", json={"files": [{"path": "../a", "bytes": 1}]})
    assert "leads elsewhere" in bad.json()["detail"]
    assert list(data.iterdir()) == []
    folder = tmp_path / "alone"
    folder.mkdir()
    detections(folder)
    info = _settled(client, _send(client, folder))
    assert (info["phase"], info["cameras"]) == ("failed", [])
    assert "no calibration was found" in info["error"]
    assert info["uploaded"]
    written = client.post(f"/api/import/{info['key']}/write", json={})
    assert "No calibration was found" in written.json()["detail"]
    toml(folder)
    text = (folder / "calibration.toml").read_bytes()
    more = [{"path": "calibration.toml", "bytes": len(text)}]
    added = client.post(f"/api/import/{info['key']}/files", json={"files": more}).json()
    early = client.post(f"/api/import/{info['key']}/arrived")
    assert "are here; drop the rest" in early.json()["detail"]
    client.put(f"/api/import/{info['key']}/files/{added['first']}", content=text)
    client.post(f"/api/import/{info['key']}/arrived")
    assert len(_settled(client, info["key"])["cameras"]) == 4


def test_recordings_have_pictures(client: TestClient) -> None:
    cards = client.get("/api/recordings").json()["recordings"]
    rooms = [card for card in cards if card["kind"] == "rendered"]
    assert "room44-3p" in [card["name"] for card in rooms]
    pictures = [client.get(card["picture"]) for card in rooms]
    assert [one.headers.get("content-type") for one in pictures] == ["image/jpeg"] * 3
    assert client.get("/api/recordings/picture?name=../secret").status_code == 404
