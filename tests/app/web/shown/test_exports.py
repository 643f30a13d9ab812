"""Runs leave through the page's routes: the shown one and kept ones, watched and stopped."""

from __future__ import annotations

import io
import json
import threading
import zipfile
from pathlib import Path

import av
import pytest
from starlette.testclient import TestClient

from app.state.tasks import Exporter
from app.state.workbench import Workbench
from app.web.dependencies import Settings
from app.web.server import create_app
from tests.app.conftest import ADDRESS, run_is, wait_until
from tests.library.written import written
from tracker.export.exported_run import ExportedRun, Options
from tracker.export.registry import FORMATS


def fetched(client: TestClient, **wish: object) -> bytes:
    begun = client.post("/api/exports", json=wish).json()
    assert begun["state"] in ("writing", "done")
    wait_until(lambda: client.get("/api/exports").json()["state"] != "writing")
    told = client.get("/api/exports").json()
    assert told["state"] == "done", told
    answer = client.get("/api/exports/file")
    assert told["name"] in answer.headers["content-disposition"]
    return answer.content


@pytest.mark.full
def test_the_shown_run(client: TestClient) -> None:
    assert fetched(client, format="csv") == client.get("/api/export/tracks.csv").content
    assert len(json.loads(fetched(client, format="json"))["tracks"]) == 2
    with zipfile.ZipFile(io.BytesIO(fetched(client, format="motchallenge"))) as archive:
        assert any(name.endswith("gt.txt") for name in archive.namelist())


@pytest.mark.full
def test_a_kept_run_as_a_video(data: Path, tmp_path: Path) -> None:
    settings = Settings(
        sequence="numbers", data=data, with_viser=False, library=tmp_path / "library.sqlite3"
    )
    with TestClient(create_app(settings), base_url=ADDRESS) as client:
        wait_until(run_is(client, "done"))
        wait_until(lambda: client.get("/api/library/runs/1").status_code == 200)
        film = fetched(client, format="mp4", run=1, first=3, last=12)
    with av.open(io.BytesIO(film)) as file:
        assert len(list(file.decode(video=0))) == 10


def test_what_cannot_be_written_is_a_sentence(own_client: TestClient) -> None:
    answer = own_client.post("/api/exports", json={"format": "mp4"})
    assert answer.status_code == 422
    assert "no pictures" in answer.json()["detail"]
    answer = own_client.post("/api/exports", json={"format": "mp5"})
    assert "expected one of csv" in answer.json()["detail"]
    assert own_client.get("/api/exports/file").status_code == 409
    names = [f["name"] for f in own_client.get("/api/exports/formats").json()["formats"]]
    assert names == list(FORMATS)


def test_one_that_is_stopped_leaves_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    exporter, waiting, go = Exporter(Workbench()), threading.Event(), threading.Event()

    def slowly() -> ExportedRun:
        waiting.set()
        go.wait(10.0)
        return written()

    exporter.start(FORMATS["trc"], slowly, "room", Options())
    waiting.wait(10.0)
    threading.Timer(0.05, go.set).start()
    exporter.cancel()
    wait_until(lambda: exporter.now.state == "cancelled")
    assert exporter.file is None
    exporter.close()
