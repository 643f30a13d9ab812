"""Tracks that cannot be: one sentence with file, place, what was expected and found."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.export.test_read_back import RUN
from tracker.export.reading import read_tracks
from tracker.export.registry import FORMATS, save
from tracker.sequences.errors import SequenceError

Change = Callable[[dict[str, Any]], object]


def _csv(path: Path, column: str, value: float) -> None:
    """Another value in the first row's column."""
    lines = path.read_text().splitlines()
    head = next(k for k, line in enumerate(lines) if not line.startswith("#"))
    cells = lines[head + 1].split(",")
    cells[lines[head].split(",").index(column)] = str(value)
    lines[head + 1] = ",".join(cells)
    path.write_text("\n".join(lines) + "\n")


@pytest.mark.parametrize(
    ("column", "value", "words"),
    [
        ("covariance_xy", 0.02, "covariance_xy: expected at most sigma_x · sigma_y in size"),
        ("covariance_xy", -0.02, "found -0.02"),
        ("height", -1.7, "height: expected at least 0 m, or nothing, found -1.7"),
        ("sigma_height", -0.1, "sigma_height: expected at least 0 m"),
        ("sigma_y", -0.1, "sigma_y: expected a standard deviation of at least 0 m, found -0.1"),
    ],
)
def test_numbers_that_cannot_be_are_refused_in_each_form(
    tmp_path: Path, column: str, value: float, words: str
) -> None:
    pq, pa = pytest.importorskip("pyarrow.parquet"), pytest.importorskip("pyarrow")
    for name in ("csv", "json", "parquet"):
        path = tmp_path / f"tracks{FORMATS[name].suffix}"
        save(path, FORMATS[name], RUN)
        read_tracks(path)
        if name == "csv":
            _csv(path, column, value)
        elif name == "json":
            told = json.loads(path.read_text())
            first = told["tracks"][0]
            if column == "sigma_y":
                first["sigmas"][0][1] = value
            else:
                first[column][0] = value
            path.write_text(json.dumps(told))
        else:
            table = pq.read_table(path)
            values = table.column(column).to_pylist()
            values[0] = value
            place = table.column_names.index(column)
            pq.write_table(table.set_column(place, column, pa.array(values)), path)
        with pytest.raises(SequenceError, match=re.escape(words)) as caught:
            read_tracks(path)
        assert str(caught.value).startswith(f"{path.name}, step 0, track 1, ")


def _shorter(told: dict[str, Any]) -> None:
    del told["tracks"][1]["sigmas"][-1]


def _twice(told: dict[str, Any]) -> None:
    told["tracks"][1]["id"] = told["tracks"][0]["id"]


def _negative(told: dict[str, Any]) -> None:
    told["tracks"][0]["frames"][0] = -1


def _infinite(told: dict[str, Any]) -> None:
    told["tracks"][0]["positions"][0][0] = float("inf")


def _without_camera(told: dict[str, Any]) -> None:
    del told["tracks"][0]["boxes"][told["sequence"]["cameras"][0]["name"]]


def _without_positions(told: dict[str, Any]) -> None:
    del told["tracks"][0]["positions"]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (_shorter, "tracks.1.sigmas: expected 27 rows as tracks.1.frames has, found 26"),
        (_twice, "expected one row a track a step, found two of track 1 at step 0"),
        (_negative, '"frame": expected whole numbers from 0, found -1'),
        (_infinite, "expected finite numbers"),
        (_without_camera, "expected 40 rows as tracks.0.frames has, found 0"),
        (_without_positions, "field tracks.0.positions: expected tracks as `track -o"),
    ],
)
def test_json_that_is_no_track_file(tmp_path: Path, change: Change, words: str) -> None:
    path = tmp_path / "tracks.json"
    save(path, FORMATS["json"], RUN)
    told = json.loads(path.read_text())
    change(told)
    path.write_text(json.dumps(told))
    with pytest.raises(SequenceError, match=re.escape(words)):
        read_tracks(path)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.json", b"[1, 2", "a.json: expected tracks as"),
        ("a.json", b'{"images": []}', "a.json, field program: expected tracks as"),
        ("a.parquet", b"PAR1nothing", "a.parquet: expected a Parquet table"),
        ("a.trc", b"frame,x\n1,2\n", "a.trc: expected places in metres as"),
        ("a.txt", b"hello\n", "a.txt: expected places in metres as"),
        ("a.csv", b"hello\n", "a.csv, line 1: expected a header"),
    ],
)
def test_a_file_of_another_kind(tmp_path: Path, name: str, content: bytes, words: str) -> None:
    if name.endswith("parquet"):
        pytest.importorskip("pyarrow")
    (tmp_path / name).write_bytes(content)
    with pytest.raises(SequenceError, match=re.escape(words)) as caught:
        read_tracks(tmp_path / name)
    assert "\n" not in str(caught.value)
    with pytest.raises(SequenceError, match="cannot be read"):
        read_tracks(tmp_path / f"none{Path(name).suffix}")


@pytest.mark.parametrize(
    ("name", "word"),
    [
        ("a.glb", "glTF"), ("a.GLTF", "glTF"), ("a.rrd", "Rerun"), ("a.html", "HTML report"),
        ("a.mp4", "MP4"),
    ],
)  # fmt: skip
def test_a_form_that_is_only_written_is_named_with_those_that_are_read(
    tmp_path: Path, name: str, word: str
) -> None:
    (tmp_path / name).write_bytes(b"glTF\x8f")
    with pytest.raises(SequenceError) as caught:
        read_tracks(tmp_path / name)
    assert str(caught.value) == (
        f"{name}: expected tracks as CSV, JSON, Parquet, TRC or MOTChallenge's ground plane, found "
        f"{word}, which is written but not read; write the run in one of those, as `runs export` "
        "does"
    )


def test_of_a_folder_the_one_file_of_the_ground_plane_is_read(tmp_path: Path) -> None:
    save(tmp_path / "mot", FORMATS["motchallenge"], RUN)
    (file,) = tmp_path.rglob("*-ground-plane.txt")
    np.testing.assert_array_equal(
        read_tracks(tmp_path / "mot").positions, read_tracks(file).positions
    )
    with pytest.raises(SequenceError, match=r"found none; name the file$"):
        read_tracks(tmp_path)
    file.with_name("b-ground-plane.txt").write_bytes(file.read_bytes())
    with pytest.raises(SequenceError, match=r"found trackers/.*, trackers/.*; name the file$"):
        read_tracks(tmp_path / "mot")


def test_a_table_of_something_else(tmp_path: Path) -> None:
    pq, pa = pytest.importorskip("pyarrow.parquet"), pytest.importorskip("pyarrow")
    pq.write_table(pa.table({"frame": [1], "id": [1]}), tmp_path / "a.parquet")
    with pytest.raises(SequenceError, match=r"but time, x, y, z, existence, .* are missing"):
        read_tracks(tmp_path / "a.parquet")
