"""``multiview-phd evaluate``: its tables, its JSON, its report, and files that do not fit."""

from __future__ import annotations

import json
import sys
from contextlib import redirect_stderr
from pathlib import Path

import pytest

from app.command.flags import Evaluate, parse
from tests.app.conftest import Runs
from tests.app.folders import FRAMES, write_crossing
from tracker.evaluation import EvaluationSettings, evaluate_sequence
from tracker.export import tracks_csv
from tracker.export.exported_run import ExportedRun
from tracker.export.registry import FORMATS, save
from tracker.runs import pipeline
from tracker.sequences.reader import read_sequence


@pytest.fixture(scope="module")
def tracks(crossing: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The track file of ``crossing``."""
    path = tmp_path_factory.mktemp("tracks") / "tracks.csv"
    sequence = read_sequence(crossing)
    parameters = pipeline.default_parameters(sequence)
    run = pipeline.compute(sequence, parameters)
    tracks_csv.save_tracks_csv(path, sequence, run.tracks, parameters, 0)
    return path


def test_the_table_says_what_was_measured_with_what(
    run: Runs, crossing: Path, tracks: Path
) -> None:
    arguments = ["--gate", "0.75", "--cutoff", "2", "--order", "2", "--window", "5"]
    status, stdout, stderr = run("evaluate", crossing, tracks, *arguments)
    assert status == 0, stderr
    settings = EvaluationSettings(gate=0.75, cutoff=2.0, order=2.0, window=5)
    sequence = read_sequence(crossing)
    expected = evaluate_sequence(sequence, tracks_csv.read_tracks_csv(tracks), settings)
    lines = stdout.splitlines()
    for figure, line in zip(expected.figures, lines[1:], strict=False):
        name = figure.definition.name
        assert line.startswith(name)
        rest = line[len(name) :].split("  ")
        assert [cell.strip() for cell in rest if cell] == [
            cell for cell in (figure.text, figure.unit, figure.measured_with) if cell
        ]
    assert "3D distance, cut-off 2 m, order 2, window 5 steps" in stdout
    assert lines[-2].split()[:2] == ["1", str(expected.people[0].steps)]
    assert stderr == f"multiview-phd: {FRAMES} steps\n"


def test_json(run: Runs, crossing: Path, tracks: Path) -> None:
    status, stdout, _ = run("evaluate", crossing, tracks, "--json", "--distance", "ground")
    assert status == 0
    found = json.loads(stdout)
    sequence = read_sequence(crossing)
    settings = EvaluationSettings(distance="ground")
    expected = evaluate_sequence(sequence, tracks_csv.read_tracks_csv(tracks), settings).to_json()
    assert found["sequence"] == "crossing"
    assert {key: found[key] for key in expected} == json.loads(json.dumps(expected))


@pytest.mark.parametrize("name", ["json", "parquet", "trc"])
def test_other_forms_of_the_same_tracks_have_the_same_figures(
    run: Runs, crossing: Path, tracks: Path, tmp_path: Path, name: str
) -> None:
    form = FORMATS[name]
    if form.needs_package:
        pytest.importorskip(form.needs_package)
    sequence = read_sequence(crossing)
    parameters = pipeline.default_parameters(sequence)
    computed = pipeline.compute(sequence, parameters)
    path = tmp_path / f"tracks{form.suffix}"
    save(path, form, ExportedRun(sequence, computed.tracks, parameters))
    figures = []
    for file in (tracks, path):
        status, stdout, stderr = run("evaluate", crossing, file, "--json")
        assert status == 0, stderr
        figures.append(json.loads(stdout)["figures"])
    for one, other in zip(*figures, strict=True):
        assert one == pytest.approx(other, abs=1e-3), "the CSV rounds to a tenth of a millimetre"


def test_report(run: Runs, crossing: Path, tracks: Path, tmp_path: Path) -> None:
    report = tmp_path / "report.html"
    status, stdout, stderr = run("evaluate", crossing, tracks, "--html", report)
    assert status == 0
    assert stdout.startswith("figure")
    assert stderr.endswith(f"the report is in {report}\n")
    assert "<h1>crossing</h1>" in report.read_text(encoding="utf-8")
    assert "seed 0" in report.read_text(encoding="utf-8")
    assert list(tmp_path.iterdir()) == [report]


def test_a_truth_that_goes_on_is_scored_as_far_as_the_recording_goes(
    run: Runs, crossing: Path, tracks: Path, tmp_path: Path
) -> None:
    own = (crossing / "truth.csv").read_text(encoding="utf-8")
    columns = own.splitlines()[0].split(",")
    given = {"id": "1", "x": "0", "y": "0", "z": "1", "valid": "1"}

    def row(step: int) -> str:
        return ",".join(str(step) if name == "frame" else given[name] for name in columns) + "\n"

    longer, later = tmp_path / "longer.csv", tmp_path / "later.csv"
    longer.write_text(own + row(FRAMES) + row(FRAMES + 5), encoding="utf-8")
    later.write_text(",".join(columns) + "\n" + row(FRAMES + 5), encoding="utf-8")
    status, expected, _ = run("evaluate", crossing, tracks, "--json")
    assert status == 0
    status, stdout, stderr = run("evaluate", crossing, tracks, "--truth", longer, "--json")
    note = f"2 of {own.count(chr(10)) + 1} rows are left out: of steps after {FRAMES - 1}"
    assert (status, note in stderr) == (0, True), stderr
    found = json.loads(stdout)
    assert found["figures"] == json.loads(expected)["figures"]
    assert note in " ".join(found["notes"])
    status, _, stderr = run("evaluate", crossing, tracks, "--truth", later)
    assert status == 1
    assert f"expected steps 0 … {FRAMES - 1} as the sequence has them, found none" in stderr


def test_what_figures_are_worth_is_said_before_them(
    run: Runs, crossing: Path, tracks: Path, tmp_path: Path
) -> None:
    head, *rows = (crossing / "truth.csv").read_text(encoding="utf-8").splitlines()
    column = head.split(",").index("x")
    cells = [row.split(",") for row in rows]
    elsewhere = tmp_path / "elsewhere.csv"
    moved = [",".join([*c[:column], str(float(c[column]) + 50), *c[column + 1 :]]) for c in cells]
    elsewhere.write_text("\n".join([head, *moved]) + "\n", encoding="utf-8")
    with redirect_stderr(sys.stdout):
        _, printed, _ = run("evaluate", crossing, tracks, "--truth", elsewhere)
    assert 0 <= printed.find("figures against it mean nothing") < printed.find("MOTA")


def test_a_partial_file_is_scored_as_far_as_it_goes(
    run: Runs, crossing: Path, tmp_path: Path
) -> None:
    sequence = read_sequence(crossing)
    parameters = pipeline.default_parameters(sequence)
    computed = pipeline.compute(sequence, parameters, steps=50)
    path = tmp_path / "part.csv"
    tracks_csv.save_tracks_csv(path, sequence, computed.tracks, parameters, 0, done=50)
    assert tracks_csv.read_tracks_csv(path).done == 50
    status, stdout, stderr = run("evaluate", crossing, path, "--json")
    assert status == 0
    assert json.loads(stdout)["steps"] == 50
    assert f"50 steps of {FRAMES} (the file is partial)" in stderr


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--gate", "wide"], "--gate: expected a number, got 'wide'"),
        (["--gate", "0"], "--gate: expected 0.01 … 100 m, got '0'"),
        (["--gate", "nan"], "--gate: expected a number, got 'nan'"),
        (["--window", "2.5"], "--window: expected a whole number, got '2.5'"),
        (["--distance", "near"], "--distance: expected one of position, ground, box, got 'near'"),
        (["--box-gate", "7"], "--box-gate: expected 0.01 … 1, got '7'"),
    ],
)
def test_a_wrong_setting_is_wrong_usage(
    run: Runs, crossing: Path, tracks: Path, arguments: list[str], words: str
) -> None:
    assert run("evaluate", crossing, tracks, *arguments) == (2, "", f"multiview-phd: {words}\n")


@pytest.mark.parametrize("arguments", [[], ["room", "tracks.csv", "--gates", "1"]])
def test_wrong_usage(run: Runs, arguments: list[str]) -> None:
    assert run("evaluate", *arguments)[0] == 2


@pytest.mark.full
def test_without_a_track_file_it_says_how_far_other_looks_agree(run: Runs, crossing: Path) -> None:
    status, stdout, stderr = run("evaluate", crossing, "--json")
    assert status == 0
    told = json.loads(stdout)
    assert 0.0 <= told["low"] <= told["estimate"] <= 1.0
    assert told["low"] <= told["high"] <= 1.0
    assert set(told["without"]) == set(told["overlap"]) == {"left", "right", "back"}
    assert "consistently wrong" in stderr
    status, _, stderr = run("evaluate", crossing, "--gate", "0.5")
    assert status == 1
    assert "--gate: expected a track file as well" in stderr


def test_files_that_do_not_fit(run: Runs, crossing: Path, tracks: Path, tmp_path: Path) -> None:
    other = write_crossing(tmp_path / "other", 30, name="other")
    short = write_crossing(tmp_path / "short", 30)
    untrue = write_crossing(tmp_path / "untrue", 30)
    toml = untrue / "sequence.toml"
    toml.write_text(toml.read_text(encoding="utf-8").split("[ground_truth]")[0], encoding="utf-8")
    foreign = tmp_path / "foreign.csv"
    foreign.write_text("frame,id,x,y,z\n0,1,0,0,0\n")
    for arguments, words in [
        ((other, tracks), 'expected tracks of the sequence "other", found those of "crossing"'),
        ((short, tracks), "expected steps 0 … 29 as crossing has them, found step"),
        ((untrue, tracks), "there is no truth to evaluate against"),
        ((crossing, foreign), "foreign.csv, line 1: expected a header"),
        ((crossing, tmp_path / "none.csv"), "none.csv: cannot be read"),
        ((tmp_path / "nowhere", tracks), "nowhere"),
        ((crossing, tracks, "--html", tmp_path), "expected a file to write, found a folder"),
        ((crossing, tracks, "--html", tmp_path / "no" / "r.html"), "there is no folder"),
    ]:
        status, stdout, stderr = run("evaluate", *arguments)
        assert (status, stdout) == (1, "")
        assert words in stderr
        assert stderr.startswith("multiview-phd: ")
        assert stderr.count("\n") == 1


def test_every_setting_has_its_flag(run: Runs) -> None:
    defaults = EvaluationSettings().model_dump()
    text = " ".join(run("evaluate", "--help")[1].replace("│", " ").split())
    for name, schema in EvaluationSettings.model_json_schema()["properties"].items():
        flag = "--" + name.replace("_", "-")
        assert flag in text
        assert " ".join(schema["description"].split()) in text
        other = "ground" if name == "distance" else schema["minimum"]
        command = parse(["evaluate", "room", "tracks.csv", flag, str(other)])
        assert isinstance(command, Evaluate)
        assert vars(command)["settings"] == EvaluationSettings(**{**defaults, name: other})
