"""The track file: what is written is what is read, wholly or not at all."""

from __future__ import annotations

import csv
import dataclasses
import io
import os
import re
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.engine import synthetic
from tracker import __version__
from tracker.export import tracks_csv
from tracker.fusion.trajectories import Trajectories
from tracker.parameters.catalogue import METHODS, PARAMETERS, RunParameters
from tracker.parameters.values import value_of, with_values
from tracker.sequences.csv_columns import guarded, unguarded
from tracker.sequences.sequence import Sequence

SEQUENCE = synthetic.sequence([], 40)
CAMERA = SEQUENCE.cameras[0].name
PARAMETERS_OF_RUN = with_values(RunParameters(), {"fusion.survival_probability": 0.97})


def tracks_of(rows: list[tuple[int, int, tuple[float, float, float]]]) -> Trajectories:
    """Targets by frame, id and position, sorted."""
    rows = sorted(rows)
    count = len(rows)
    positions = np.array([row[2] for row in rows]).reshape(-1, 3)
    return dataclasses.replace(
        Trajectories.empty(len(SEQUENCE.views)),
        frames=np.array([row[0] for row in rows], dtype=np.int64),
        ids=np.array([row[1] for row in rows], dtype=np.int64),
        positions=positions,
        existences=np.linspace(0.5, 1.25, count),
        sigmas=np.abs(positions) / 10.0,
        seen=np.ones((count, len(SEQUENCE.views)), dtype=bool),
        components=np.zeros(count, dtype=np.int64),
        covariances_xy=np.linspace(-0.9, 0.9, count) * np.prod(positions[:, :2], axis=1) / 100.0,
        heights=np.where(np.arange(count) % 2, 1.7, np.nan),
        sigma_heights=np.where(np.arange(count) % 2, 0.02, np.nan),
    )


TRACKS = tracks_of(
    [
        (0, 1, (0.0, 0.0, 0.9)),
        (0, 2, (0.51234, -0.4, 0.90006)),
        (7, 2, (0.6, -0.00001, 1.0)),
        (39, 11, (60.0, -70.0, 90.0)),
    ]
)


def text_of(tracks: Trajectories, sequence: Sequence = SEQUENCE, done: int | None = None) -> str:
    stream = io.StringIO(newline="")
    tracks_csv.write_tracks_csv(stream, sequence, tracks, PARAMETERS_OF_RUN, 5, done=done)
    return stream.getvalue()


def table_of(text: str) -> list[list[str]]:
    return [line.split(",") for line in text.splitlines() if not line.startswith("#")]


def test_the_columns_are_those_of_the_format() -> None:
    header, *rows = table_of(text_of(TRACKS))
    assert header[:10] == "frame,time,id,x,y,z,existence,sigma_x,sigma_y,sigma_z".split(",")
    names = [camera.name for camera in SEQUENCE.cameras]
    assert header[10:] == [
        *(f"{name}_{side}" for name in names for side in ("left", "top", "width", "height")),
        "covariance_xy",
        "height",
        "sigma_height",
    ]
    assert {len(row) for row in rows} == {len(header)}
    assert rows[1][:10] == [
        "0", "0.000000", "2", "0.5123", "-0.4000", "0.9001", "0.7500", "0.0512", "0.0400", "0.0900",
    ]  # fmt: skip
    assert rows[2][1] == "0.280000"
    assert rows[2][4] == "0.0000"  # no minus before nothing


def test_boxes_are_the_reprojected_ones_and_empty_outside() -> None:
    rows = table_of(text_of(TRACKS))[1:]
    for number, camera in enumerate(SEQUENCE.cameras):
        boxes, visible = camera.project_boxes(TRACKS.positions, SEQUENCE.target_half_extents)
        assert visible[:3].all()
        assert not visible[3]
        cells = [row[10 + 4 * number : 14 + 4 * number] for row in rows]
        assert cells[3] == ["", "", "", ""]
        np.testing.assert_allclose(np.array(cells[:3], dtype=float), boxes[:3], atol=0.00501)


def test_the_comments_say_what_made_it() -> None:
    lines = [line for line in text_of(TRACKS).splitlines() if line.startswith("#")]
    assert text_of(TRACKS).splitlines()[: len(lines)] == lines
    assert lines[0] == f"# multiview-phd {__version__}"
    assert lines[1:3] == [f"# sequence = {SEQUENCE.name}", "# seed = 5"]
    for key in (*METHODS, *PARAMETERS):
        setting = str(value_of(PARAMETERS_OF_RUN, key))
        assert f"# {key} = {setting.lower() if setting in ('True', 'False') else setting}" in lines
    assert "# fusion.survival_probability = 0.97" in lines


def test_a_partial_run_says_so() -> None:
    assert "# partial: the first 8 of 40 steps\n" in text_of(TRACKS, done=8)
    assert "partial" not in text_of(TRACKS, done=40)


def test_a_name_over_two_lines_stays_in_its_comment() -> None:
    odd = dataclasses.replace(SEQUENCE, name="one\n1,2,3")
    assert "\n# sequence = one 1,2,3\n" in text_of(TRACKS, odd)


def test_what_is_read_is_what_was_written(tmp_path: Path) -> None:
    path = tmp_path / "tracks.csv"
    tracks_csv.save_tracks_csv(path, SEQUENCE, TRACKS, PARAMETERS_OF_RUN, 5)
    read = tracks_csv.read_tracks_csv(path)
    assert len(read) == 4
    np.testing.assert_array_equal(read.frames, TRACKS.frames)
    np.testing.assert_array_equal(read.ids, TRACKS.ids)
    np.testing.assert_allclose(read.times, TRACKS.frames / SEQUENCE.fps, atol=1e-6)
    np.testing.assert_allclose(read.positions, TRACKS.positions, atol=0.5001e-4)
    np.testing.assert_allclose(read.existences, TRACKS.existences, atol=0.5001e-4)
    np.testing.assert_allclose(read.sigmas, TRACKS.sigmas, atol=0.5001e-4)
    assert read.covariances_xy is not None
    np.testing.assert_allclose(read.covariances_xy, TRACKS.covariances_xy, atol=0.5001e-6)
    assert read.heights is not None
    assert read.sigma_heights is not None
    np.testing.assert_array_equal(read.heights, TRACKS.heights)  # empty where there is none
    np.testing.assert_array_equal(read.sigma_heights, TRACKS.sigma_heights)
    for camera in SEQUENCE.cameras:
        boxes, visible = camera.project_boxes(TRACKS.positions, SEQUENCE.target_half_extents)
        np.testing.assert_array_equal(np.isnan(read.boxes[camera.name]).all(axis=1), ~visible)
        np.testing.assert_allclose(read.boxes[camera.name][visible], boxes[visible], atol=0.00501)


def test_the_settings_make_the_same_parameters_again(tmp_path: Path) -> None:
    path = tmp_path / "tracks.csv"
    tracks_csv.save_tracks_csv(path, SEQUENCE, TRACKS, PARAMETERS_OF_RUN, 5)
    settings = dict(tracks_csv.read_tracks_csv(path).settings)
    assert settings.pop("sequence") == SEQUENCE.name
    assert settings.pop("seed") == "5"
    assert with_values(RunParameters(), settings) == PARAMETERS_OF_RUN


coordinates = st.floats(-5.0, 5.0, allow_nan=False)
targets = st.dictionaries(
    st.tuples(st.integers(0, 39), st.integers(1, 5)),
    st.tuples(coordinates, coordinates, coordinates),
    max_size=12,
)


@given(people=targets)
def test_reading_and_writing_again_changes_nothing(
    tmp_path_factory: pytest.TempPathFactory,
    people: dict[tuple[int, int], tuple[float, float, float]],
) -> None:
    tracks = tracks_of([(frame, number, place) for (frame, number), place in people.items()])
    once = text_of(tracks)
    path = tmp_path_factory.getbasetemp() / "tracks.csv"
    path.write_text(once, encoding="utf-8")
    read = tracks_csv.read_tracks_csv(path)
    again = dataclasses.replace(
        tracks, positions=read.positions, existences=read.existences, sigmas=read.sigmas
    )
    first, second = table_of(once), table_of(text_of(again))
    assert [row[:10] for row in first] == [row[:10] for row in second]


def test_no_tracks_make_a_file_with_a_header(tmp_path: Path) -> None:
    path = tmp_path / "none.csv"
    tracks_csv.save_tracks_csv(path, SEQUENCE, tracks_of([]), RunParameters(), 0)
    read = tracks_csv.read_tracks_csv(path)
    assert len(read) == 0
    assert read.positions.shape == (0, 3)
    assert set(read.boxes) == {camera.name for camera in SEQUENCE.cameras}


@pytest.mark.parametrize("error", [KeyboardInterrupt, MemoryError, OSError(28, "No space left")])
def test_an_interrupted_save_leaves_what_was_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: BaseException
) -> None:
    path = tmp_path / "tracks.csv"
    path.write_text("before", encoding="utf-8")

    def interrupted(stream: io.TextIOBase, *_: object, **__: object) -> None:
        stream.write("half a ")
        raise error

    monkeypatch.setattr(tracks_csv, "write_tracks_csv", interrupted)
    with pytest.raises((KeyboardInterrupt, MemoryError, OSError)):
        tracks_csv.save_tracks_csv(path, SEQUENCE, TRACKS, RunParameters(), 0)
    assert path.read_text(encoding="utf-8") == "before"
    assert list(tmp_path.iterdir()) == [path]


def test_where_it_cannot_be_written_is_said(tmp_path: Path) -> None:
    nowhere = tmp_path / "nowhere" / "tracks.csv"
    with pytest.raises(OSError, match=r"tracks\.csv: there is no folder .*nowhere to write it to"):
        tracks_csv.save_tracks_csv(nowhere, SEQUENCE, TRACKS, RunParameters(), 0)
    with pytest.raises(OSError, match="expected a file to write, found a folder; add a name"):
        tracks_csv.save_tracks_csv(tmp_path, SEQUENCE, TRACKS, RunParameters(), 0)


def test_a_link_is_followed_and_a_new_file_is_readable_by_all(tmp_path: Path) -> None:
    target, link = tmp_path / "target.csv", tmp_path / "link.csv"
    try:
        link.symlink_to(target)
    except OSError:
        pytest.skip("symbolic links cannot be made here")
    tracks_csv.save_tracks_csv(link, SEQUENCE, TRACKS, RunParameters(), 0)
    assert link.is_symlink()
    assert len(tracks_csv.read_tracks_csv(target)) == 4
    (tmp_path / "plain").touch()
    assert target.stat().st_mode == (tmp_path / "plain").stat().st_mode


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_a_pipe_is_written_to(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    received: list[str] = []
    thread = threading.Thread(target=lambda: received.append(pipe.read_text(encoding="utf-8")))
    thread.start()
    tracks_csv.save_tracks_csv(pipe, SEQUENCE, TRACKS, PARAMETERS_OF_RUN, 5)
    thread.join()
    assert received == [text_of(TRACKS)]


FORMULAS = ["=1+1", "+1", "-1", "@SUM(A1)", "'=1", "=HYPERLINK('http://x')", "a;=1", "x"]


@pytest.mark.parametrize("name", FORMULAS)
def test_a_name_is_no_formula_and_comes_back(tmp_path: Path, name: str) -> None:
    first, *others = SEQUENCE.views
    camera = first.camera
    named = replace(camera, name=name)
    views = (replace(first, camera=named), *others)
    sequence = replace(SEQUENCE, name=f"{name}, {name}", views=views)
    path = tmp_path / "tracks.csv"
    remark = f'40 pictures of camera "{name}" are missing'
    tracks_csv.save_tracks_csv(path, sequence, TRACKS, PARAMETERS_OF_RUN, 5, remarks=(remark,))
    for line in path.read_text(encoding="utf-8").splitlines():
        for cells in (csv.reader([line]), csv.reader([line], delimiter=";")):
            for cell in next(cells):
                risky = re.match(r"\s*[=+\-@]", cell)
                assert not risky or re.fullmatch(r"-?[\d.]+(,.*)?", cell), line
    found = tracks_csv.read_tracks_csv(path)
    assert found.settings["sequence"] == sequence.name
    assert list(found.boxes) == [one.camera.name for one in views]
    assert found.remarks == (remark,)


@given(st.text(alphabet="=+-@',; a\t\r"))
def test_what_is_guarded_is_what_it_was(text: str) -> None:
    assert unguarded(guarded(text)) == text


def test_who_was_named_has_the_name_in_every_row(tmp_path: Path) -> None:
    path = tmp_path / "tracks.csv"
    with path.open("w", encoding="utf-8", newline="") as stream:
        tracks_csv.write_tracks_csv(
            stream, SEQUENCE, TRACKS, PARAMETERS_OF_RUN, 5, names={2: "Anna, the =first"}
        )
    lines = [one for one in path.read_text("utf-8").splitlines() if not one.startswith("#")]
    rows = list(csv.DictReader(lines))
    assert [unguarded(row["name"]) for row in rows] == [
        "", "Anna, the =first", "Anna, the =first", "",
    ]  # fmt: skip
    assert len(tracks_csv.read_tracks_csv(path)) == len(TRACKS)
    assert tracks_csv.NAME not in table_of(text_of(TRACKS))[0]
