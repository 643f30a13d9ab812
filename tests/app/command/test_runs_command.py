"""``runs`` and ``library`` in a terminal."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.app.conftest import Runs
from tests.library.runs import RECORDING, filled, made_by_the_version_before
from tests.library.runs import run as made
from tracker.export.reading import read_tracks
from tracker.library.store import Library
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.values import with_values
from tracker.sequences.reader import WHERE_NOW


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "library.sqlite3"


def asked(run: Runs, *arguments: object) -> list | dict:
    status, out, err = run("runs", *arguments, "--json")
    assert status == 0, err
    told: list | dict = json.loads(out)
    return told


@pytest.mark.full
def test_track_keeps_its_run(run: Runs, crossing: Path, path: Path, tmp_path: Path) -> None:
    line = ["track", crossing, "-o", tmp_path / "tracks.csv", "--library", path]
    line += ["--set", "fusion.clutter_rate=1.5"]
    assert run(*line)[0] == 0
    (listed,) = asked(run, "list", "--library", path)
    assert listed["changes"] == {"fusion.clutter_rate": 1.5}
    assert (listed["source"], listed["steps"]) == ("track", 120)
    _, out, _ = run("evaluate", crossing, tmp_path / "tracks.csv", "--json")
    figures = {f["key"]: f["value"] for f in json.loads(out)["figures"]}
    assert listed["mota"] == pytest.approx(figures["mota"], abs=1e-3)  # the file is rounded
    told = asked(run, "show", str(listed["id"]), "--library", path)
    assert told["figures"]["mota"] == listed["mota"]
    assert told["parameters"]["fusion"]["clutter_rate"] == 1.5


@pytest.mark.full
def test_keep_0_keeps_nothing(run: Runs, crossing: Path, path: Path, tmp_path: Path) -> None:
    line = ["track", crossing, "-o", tmp_path / "tracks.csv", "--library", path]
    assert run(*line, "--keep", "0")[0] == 0
    assert not path.exists()
    assert run(*line, "--keep", "-1")[0] == 2


@pytest.mark.full
def test_a_damaged_library_does_not_keep_track_from_its_work(
    run: Runs, crossing: Path, path: Path, tmp_path: Path
) -> None:
    path.write_bytes(b"something else " * 100)
    output = tmp_path / "tracks.csv"
    status, _, err = run("track", crossing, "-o", output, "--library", path)
    assert status == 0
    assert output.is_file()
    assert "the run was not kept: " in err
    assert "damaged" in err


def test_runs_are_named_starred_deleted_and_taken_back(run: Runs, path: Path) -> None:
    filled(path, 3).close()
    at = ("--library", path)
    assert asked(run, "rename", "2", "base line", *at)[0]["name"] == "base line"
    assert asked(run, "star", "base line", "3", *at)[1]["star"] is True
    assert asked(run, "star", "3", "--off", *at)[0]["star"] is False
    assert asked(run, "delete", "base line", *at)["deleted"] == [2]
    assert [r["id"] for r in asked(run, "list", *at)] == [3, 1]
    assert asked(run, "delete", "--undo", "2", *at)[0]["id"] == 2
    assert asked(run, "gc", "--keep", "1", *at)["deleted"] == 1
    assert [r["id"] for r in asked(run, "list", *at)] == [3, 2]
    assert asked(run, "list", "--recording", "nowhere", *at) == []


@pytest.mark.full
def test_a_kept_run_is_exported_as_track_writes_it(
    run: Runs, crossing: Path, path: Path, tmp_path: Path
) -> None:
    first, second = tmp_path / "first.json", tmp_path / "second.json"
    assert run("track", crossing, "-o", first, "--library", path)[0] == 0
    told = asked(run, "export", "1", "-o", second, "--library", path)
    assert told == {"run": 1, "format": "json", "file": str(second)}
    a, b = (json.loads(file.read_text(encoding="utf-8")) for file in (first, second))
    for one, other in zip(a["tracks"], b["tracks"], strict=True):
        assert one["positions"] == other["positions"]
        assert one["boxes"] == other["boxes"]
    assert a["run"] == b["run"]
    folder = tmp_path / "mot"
    line = ["runs", "export", "1", "-o", folder, "--format", "motchallenge", "--library", path]
    assert run(*line)[0] == 0
    assert list(folder.rglob("gt.txt")) != []


def test_tracks_leave_without_the_folder_of_their_recording(
    run: Runs, path: Path, tmp_path: Path
) -> None:
    gone = tmp_path / "gone"
    with Library(path) as library:
        library.keep(replace(RECORDING, place=str(gone), kind="folder"), made(1))
        positions = library.result(1).kept.tracks.positions
    for name in ("a.csv", "a.json", "a.parquet", "a.trc"):
        status, _, err = run("runs", "export", "1", "-o", tmp_path / name, "--library", path)
        assert status == 0, err
    for name in ("a.csv", "a.json", "a.parquet"):
        found = read_tracks(tmp_path / name)
        np.testing.assert_allclose(found.positions, positions, atol=1e-4)
        assert found.boxes == {}
    assert "the recording was not in" in (tmp_path / "a.csv").read_text(encoding="utf-8")
    assert (tmp_path / "a.trc").read_text(encoding="ascii").count("\n") == 46
    for line in (
        ["bundle", "1", "-o", tmp_path / "a.zip"],
        ["runs", "export", "1", "-o", tmp_path / "a.html"],
        ["runs", "export", "1", "-o", tmp_path / "a.mp4"],
        ["runs", "export", "1", "-o", tmp_path / "a.glb"],
        ["runs", "export", "1", "-o", tmp_path / "mot", "--format", "motchallenge"],
    ):
        status, _, err = run(*line, "--library", path)
        assert status == 1
        assert f"in {gone} any more" in err
        assert WHERE_NOW in err


def test_a_run_is_not_exported_under_an_unknown_ending(
    run: Runs, path: Path, tmp_path: Path
) -> None:
    filled(path, 1).close()
    status, out, err = run("runs", "export", "1", "-o", tmp_path / "a.xyz", "--library", path)
    assert (status, out) == (1, "")
    assert "a.xyz: expected a name that ends in one of .csv, .json, .parquet" in err


def test_what_a_form_needs_is_told_before_any_work(
    run: Runs, crossing: Path, path: Path, tmp_path: Path
) -> None:
    status, _, err = run("track", crossing, "-o", tmp_path / "film.mp4", "--library", path)
    assert status == 1
    assert "no pictures to make a video of" in err
    assert not path.exists()


def test_two_runs_are_set_against_each_other(run: Runs, path: Path) -> None:
    values = with_values(RunParameters(), {"fusion.clutter_rate": 4.0}).model_dump(mode="json")
    with filled(path, 1) as library:
        library.keep(RECORDING, made(1, parameters=values, figures={"mota": 0.5}))
    told = asked(run, "diff", "1", "2", "--library", path)
    assert told["values"]["fusion.clutter_rate"][1] == 4.0
    assert len(told["values"]) == 1
    assert told["figures"]["mota"] == [0.9, 0.5]
    status, out, _ = run("runs", "diff", "1", "2", "--library", path)
    assert status == 0
    assert "fusion.clutter_rate" in out


def test_a_person_reads_a_table(run: Runs, path: Path) -> None:
    filled(path, 2).close()
    status, out, _ = run("runs", "list", "--library", path)
    assert status == 0
    head, first, _ = out.splitlines()
    assert head.split()[:2] == ["run", "name"]
    assert "colour_phd › multi_bernoulli" in first
    status, out, _ = run("runs", "show", "1", "--library", path)
    assert "value fusion.clutter_rate" in out


def test_what_is_not_there_is_a_sentence(run: Runs, path: Path) -> None:
    status, _, err = run("runs", "list", "--library", path)
    assert status == 1
    assert "no library yet" in err
    filled(path, 1).close()
    status, _, err = run("runs", "show", "baseline", "--library", path)
    assert status == 1
    assert "expected one run called 'baseline', found none" in err


def test_check_and_repair(run: Runs, path: Path) -> None:
    filled(path, 3).close()
    status, out, err = run("library", "check", "--library", path)
    assert (status, out) == (0, "")
    assert "3 runs can be read, 0 complaints" in err
    with Library(path) as library:
        library._connection.execute("UPDATE results SET columns = x'00' WHERE run = 2")
    status, out, _ = run("library", "check", "--library", path, "--json")
    assert (status, json.loads(out)["readable_runs"]) == (1, 2)
    status, out, _ = run("library", "check", "--library", path, "--repair", "--json")
    told = json.loads(out)
    assert (status, told["saved_runs"]) == (0, 2)
    assert Path(told["copy"]).is_file()
    assert [r["id"] for r in asked(run, "list", "--library", path)] == [3, 1]
    assert run("library", "check", "--library", path)[0] == 0


def test_provisional_figures_are_in_brackets_with_what_to_do(run: Runs, path: Path) -> None:
    with Library(path) as library:
        library.keep(RECORDING, made(1, source="page"))
        library.keep(RECORDING, made(2, source="track"))
    made_by_the_version_before(path)
    _, out, err = run("runs", "list", "--library", path)
    assert out.count("(0.900)") == 1
    assert out.count(" 0.900") == 1
    assert "in brackets are provisional: made before the run was finished" in err
    assert [one["provisional"] for one in asked(run, "list", "--library", path)] == [False, True]
    _, out, _ = run("runs", "show", "1", "--library", path)
    assert "provisional: made before" in out
    assert "(0.900)" in out
    told = asked(run, "diff", "1", "2", "--library", path)
    assert told["provisional"] == [1]
