"""A run in one ZIP file: what it holds, that it opens elsewhere, and archives that do harm."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from starlette.testclient import TestClient

from app.web.dependencies import Settings
from app.web.server import create_app
from tests.app.conftest import ADDRESS, Runs, wait_until
from tests.app.conftest import run as run  # a fixture
from tests.app.folders import write_crossing
from tests.library.runs import run as made
from tests.library.runs import tracks
from tests.synthetic import write_sequence
from tracker.library.bundle import unpack_bundle, write_bundle
from tracker.library.keeping import record_of_recording
from tracker.library.records import Result
from tracker.library.store import Library
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.reader import read_sequence
from tracker.sequences.sequence import Detections


def kept(folder: Path, library: Path) -> Result:
    """A run of a sequence, put into a library by hand."""
    sequence = read_sequence(folder)
    result = tracks(sequence.frames, 2, cameras=len(sequence.views))
    with Library(library) as opened:
        number = opened.keep(record_of_recording(sequence, str(folder)), made(1, kept=result))
        return opened.result(number)


@pytest.fixture
def bundle(tmp_path: Path) -> tuple[Path, Result]:
    """Of a sequence with boxes and truth."""
    folder = write_crossing(tmp_path / "crossing", 60)
    result = kept(folder, tmp_path / "library.sqlite3")
    path = tmp_path / "run.zip"
    write_bundle(path, result, read_sequence(folder))
    return path, result


@pytest.mark.full
def test_everything_comes_back(bundle: tuple[Path, Result], tmp_path: Path) -> None:
    path, result = bundle
    back = unpack_bundle(path, tmp_path / "elsewhere")
    assert (back.run, back.values) == (result.run, result.values)
    np.testing.assert_array_equal(back.kept.tracks.positions, result.kept.tracks.positions)
    there, here = read_sequence(Path(back.place)), read_sequence(tmp_path / "crossing")
    assert (there.name, there.frames, there.fps) == (here.name, here.frames, here.fps)
    np.testing.assert_array_equal(there.room.maximum, here.room.maximum)
    for one, other in zip(there.views, here.views, strict=True):
        np.testing.assert_array_equal(one.camera.intrinsics, other.camera.intrinsics)
        np.testing.assert_array_equal(one.camera.rotation, other.camera.rotation)
        np.testing.assert_array_equal(one.camera.distortion, other.camera.distortion)
        assert one.detections is not None
        assert other.detections is not None
        np.testing.assert_allclose(one.detections.boxes, other.detections.boxes)
    assert there.ground_truth is not None
    assert here.ground_truth is not None
    np.testing.assert_allclose(there.ground_truth.positions, here.ground_truth.positions)
    assert "MOTA" in (tmp_path / "elsewhere" / "report.html").read_text(encoding="utf-8")
    assert (tmp_path / "elsewhere" / "tracks.csv").is_file()


@pytest.mark.full
def test_a_camera_without_a_picture_is_blind_elsewhere_too(tmp_path: Path) -> None:
    folder = write_crossing(tmp_path / "crossing", 60)
    sequence = read_sequence(folder)
    looked_at = np.arange(60) % 7 != 3
    view = sequence.views[0]
    assert view.detections is not None
    chosen = looked_at[view.detections.frames] & (view.detections.frames > 5)
    every = view.detections
    looks = np.eye(5, dtype=np.float16)[np.arange(chosen.sum()) % 5]
    boxes = Detections(every.frames[chosen], every.boxes[chosen], every.scores[chosen], looks)
    odd = replace(view, detections=boxes, detector_ran=looked_at)
    path = tmp_path / "run.zip"
    result = kept(folder, tmp_path / "library.sqlite3")
    write_bundle(path, result, replace(sequence, views=(odd, *sequence.views[1:])))
    there = read_sequence(Path(unpack_bundle(path, tmp_path / "elsewhere").place)).views
    assert there[0].detector_ran is not None
    np.testing.assert_array_equal(there[0].detector_ran, looked_at)
    assert there[0].detections is not None
    np.testing.assert_array_equal(there[0].detections.frames, boxes.frames)
    np.testing.assert_array_equal(there[0].detections.embeddings, looks)
    assert there[1].detector_ran is None


@pytest.mark.full
def test_small_videos_show_the_same_steps(tmp_path: Path) -> None:
    folder = write_sequence(tmp_path / "numbers", frames=12, first_frame=3)
    result = kept(folder, tmp_path / "library.sqlite3")
    path = tmp_path / "run.zip"
    write_bundle(path, result, read_sequence(folder), videos=True)
    back = unpack_bundle(path, tmp_path / "elsewhere")
    with (
        FrameReader(read_sequence(Path(back.place))) as there,
        FrameReader(read_sequence(folder)) as here,
    ):
        for step in (0, 5, 11):
            one, other = there.picture(0, step), here.picture(0, step)
            assert one is not None
            assert other is not None
            assert np.abs(one.astype(int) - other.astype(int)).mean() < 12.0


@pytest.fixture
def served(tmp_path: Path) -> Iterator[TestClient]:
    """A bundle without pictures and boxes, which nothing could be computed of."""
    folder = write_sequence(tmp_path / "numbers", frames=30)
    result = kept(folder, tmp_path / "library.sqlite3")
    path = tmp_path / "run.zip"
    write_bundle(path, result, read_sequence(folder))
    unpacked = unpack_bundle(path, tmp_path / "elsewhere")
    app = create_app(Settings(run=unpacked, with_viser=False))
    with TestClient(app, base_url=ADDRESS) as client:
        wait_until(lambda: client.get("/api/state").json()["run"]["kept"] == 1)
        yield client


def test_it_is_served_read_only(served: TestClient) -> None:
    step = served.get("/api/step/10").json()
    assert len(step["tracks"]) == 2
    assert served.post("/api/seek", json={"step": 4}).status_code == 200
    for method, path, body in (
        ("POST", "/api/commands", {"name": "set_parameters", "changes": {}}),
        ("POST", "/api/run", {}),
        ("POST", "/api/sequence", {"name": "room44-3p"}),
        ("POST", "/api/commands", {"name": "save_taught"}),
        ("DELETE", "/api/run/pin", {}),
    ):
        answer = served.request(method, path, json=body)
        assert answer.status_code == 403, path
        assert "only looked at" in answer.json()["detail"]
    state = served.get("/api/state").json()["run"]
    assert (state["state"], state["done"]) == ("done", 30)


def test_the_command(run: Runs, tmp_path: Path) -> None:
    folder = write_crossing(tmp_path / "crossing", 60)
    library = tmp_path / "library.sqlite3"
    kept(folder, library)
    status, out, err = run(
        "bundle", "1", "-o", tmp_path / "run.zip", "--library", library, "--json"
    )
    assert status == 0, err
    assert json.loads(out)["run"] == 1
    assert unpack_bundle(tmp_path / "run.zip", tmp_path / "x").run.id == 1
    status, _, err = run("bundle", "1", "-o", tmp_path / "run.tar", "--library", library)
    assert status == 1
    assert "name of a .zip file" in err
