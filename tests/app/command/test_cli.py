"""The command line: status, messages, flags, and the file that appears whole or not at all."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from app.command import listing, studies
from app.command import main as cli
from app.command.flags import Track, parse
from app.command.terminal import rate
from app.state.presets import keep_preset
from tests.app.conftest import Runs
from tests.app.folders import write_crossing
from tracker import __version__
from tracker.export import tracks_csv
from tracker.kernels import compilation
from tracker.parameters.catalogue import METHODS, PARAMETERS, PRESETS, REMOVED, RunParameters
from tracker.parameters.values import ParameterError, value_of, with_values
from tracker.runs import pipeline
from tracker.runs.pipeline import Run
from tracker.sequences.reader import read_sequence
from tracker.studies.definition import read_definition

P_D = "fusion.detection_probability"


def engine_csv(crossing: Path, path: Path, changes: dict[str, Any], seed: int = 0) -> str:
    sequence = read_sequence(crossing)
    wanted = with_values(pipeline.default_parameters(sequence), changes)
    computed = pipeline.compute(sequence, wanted, seed=seed)
    tracks_csv.save_tracks_csv(path, sequence, computed.tracks, wanted, seed)
    return path.read_text(encoding="utf-8")


def test_a_rate_below_one_is_not_told_as_none() -> None:
    assert [rate(value) for value in (123.4, 9.96, 4.24, 0.43, 0.0432)] == [
        "123", "10", "4.2", "0.43", "0.043",
    ]  # fmt: skip


@pytest.mark.full
def test_track_writes_the_engines_tracks(run: Runs, crossing: Path, tmp_path: Path) -> None:
    out = tmp_path / "tracks.csv"
    status, stdout, stderr = run("track", crossing, "-o", out, "--seed", 3)
    assert (status, stdout) == (0, "")
    summary = stderr.strip().splitlines()[-1]
    assert summary.startswith("multiview-phd: 120 steps, ")
    assert "steps/s" in summary
    assert summary.endswith(f"written to {out}")
    assert out.read_text(encoding="utf-8") == engine_csv(crossing, tmp_path / "own.csv", {}, 3)
    assert len(tracks_csv.read_tracks_csv(out).frames) > 100


@pytest.mark.full
@pytest.mark.parametrize(
    "arguments",
    [
        ["--set", "fusion.detection_probability=0.9", "--set", "fusion.motion=random_walk"],
        ["--fusion.detection-probability", "0.9", "--fusion.motion", "random_walk"],
        [
            *("--set", "fusion.motion=constant_velocity", "--fusion.motion", "random_walk"),
            *("--set", "fusion.detection_probability = 0.9"),
        ],
    ],
)
def test_parameters_by_set_and_by_flag(
    run: Runs, crossing: Path, tmp_path: Path, arguments: list[str]
) -> None:
    out = tmp_path / "tracks.csv"
    assert run("track", crossing, "-o", out, *arguments)[0] == 0
    changes = {P_D: 0.9, "fusion.motion": "random_walk"}
    assert out.read_text(encoding="utf-8") == engine_csv(crossing, tmp_path / "own.csv", changes)


@pytest.mark.full
def test_stage_1_is_kept_for_the_next_run_unless_told_otherwise(
    run: Runs, data: Path, tmp_path: Path, own_cache: Path
) -> None:
    out = tmp_path / "tracks.csv"
    line = ("track", data / "numbers", "-o", out, "--colour-phd.samples", "60")
    status, _, stderr = run(*line, "--no-cache")
    assert status == 0
    assert not (own_cache / "stages").exists()
    first = out.read_text(encoding="utf-8")
    assert "was kept" not in run(*line)[2]
    assert len(list((own_cache / "stages").glob("*"))) == 1
    out.unlink()
    status, _, stderr = run(*line)
    assert (status, "stage 1 was kept from an earlier run" in stderr) == (0, True)
    assert out.read_text(encoding="utf-8") == first
    assert "was kept" not in run(*line, "--no-cache")[2]


def test_benchmarks_run_from_a_checkout(
    run: Runs, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lines: list[tuple[list[str], Path]] = []

    def note(line: list[str], cwd: Path) -> subprocess.CompletedProcess[str]:
        lines.append((line[1:], cwd))
        return subprocess.CompletedProcess(line, 1)

    monkeypatch.setattr(listing.subprocess, "run", note)
    wanted = tmp_path / "figures.json"
    assert run("benchmark", "kernels", "targets", "--short", "--json", wanted, "--record")[0] == 1
    chart = tmp_path / "chart.html"
    run("benchmark", "--chart", chart)
    (line, where), (drawn, _) = lines
    assert line == [
        *("-m", "tests.benchmarks", "kernels", "targets", "--short"),
        *("--json", str(wanted), "--record"),
    ]
    assert drawn == ["-m", "tests.benchmarks", "--chart", str(chart)]
    assert (where / "tests" / "benchmarks" / "__main__.py").is_file()


def test_an_installed_package_says_where_its_benchmarks_are(
    run: Runs, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        listing,
        "__file__",
        str(tmp_path / "site-packages" / "app" / "command" / "commands" / "listing.py"),
    )
    status, _, stderr = run("benchmark")
    assert status == 1
    assert "get a checkout" in stderr
    assert len(stderr.strip().splitlines()) == 1


def test_every_parameter_has_its_flag() -> None:
    line = ["track", "room", "-o", "x.csv"]
    for key, parameter in PARAMETERS.items():
        default = parameter.default
        text = str(default).lower() if parameter.kind == "bool" else str(default)
        line += ["--" + key.replace("_", "-"), text]
    command = parse(line)
    assert isinstance(command, Track)
    changes = command.changes()
    assert list(changes) == list(PARAMETERS)
    checked = with_values(RunParameters(), changes)
    for key, parameter in PARAMETERS.items():
        assert value_of(checked, key) == parameter.default


def test_help_names_every_flag_with_range_and_default(run: Runs) -> None:
    status, stdout, _ = run("track", "--help")
    assert status == 0
    text = " ".join(stdout.replace("│", " ").split())
    for key, parameter in PARAMETERS.items():
        assert "--" + key.replace("_", "-") in text
        assert " ".join(parameter.help.split()) in text


@pytest.mark.full
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--set", "fusion.survival_probabilty=0.9"], "did you mean fusion.survival_probability?"),
        (["--set", "fusion.survival_probability"], "--set: expected KEY=VALUE"),
        (["--fusion.survival-probability", "2"], "must be between 0.5 and 1, got 2"),
        (["--fusion.survival-probability", "much"], "expected a number, got 'much'"),
        (["--preset", "magic"], "--preset: expected one of robust, published"),
        (["--fusion", "magic"], "expected one of sequential_phd"),
        (["--single-view", "magic"], "expected one of colour_phd"),
        (["--seed", "-1"], "--seed: expected a whole number from 0, got -1"),
    ],
)
def test_a_wrong_value_is_wrong_usage(
    run: Runs, crossing: Path, tmp_path: Path, arguments: list[str], words: str
) -> None:
    status, stdout, stderr = run("track", crossing, "-o", tmp_path / "x.csv", *arguments)
    assert (status, stdout) == (2, "")
    assert words in stderr
    assert stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.full
@pytest.mark.parametrize(
    "arguments",
    [[], ["fly"], ["track"], ["track", "room"], ["track", "room", "-o", "x", "--wrong"]],
)
def test_wrong_usage(run: Runs, arguments: list[str]) -> None:
    assert run(*arguments)[0] == 2


def test_a_mistyped_command_is_told_the_nearest(run: Runs) -> None:
    status, _, stderr = run("sequence")
    assert (status, stderr.count("\n")) == (2, 1)
    assert 'did you mean "sequences"?' in stderr


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("runs lst", 'runs lst: expected one of the commands list, .*; did you mean "list"?'),
        ("detector gt", 'detector gt: .*; did you mean "get"?'),
        ("library chek", "library: expected one of check, got 'chek'; did you mean \"check\"?"),
        ("import x --fps abc", "--fps: expected a number, got 'abc'"),
        ("import x --fps=abc", "--fps: expected a number, got 'abc'"),
        ("import x --dry-run --fps 0", "--fps: expected greater than 0, got '0'"),
        (
            "import x --dry-run --unit kg",
            "--unit: expected 'm', 'cm' or 'mm' or a valid number, got 'kg'",
        ),
        ("import x --dry-run --swap one", "--swap: expected NAME=NAME, got 'one'"),
        ("import x --fps nan", "--fps: expected a number, got 'nan'"),
        ("serve --disk nan", "--disk: expected a number, got 'nan'"),
        ("runs export 1 -o a.mp4 --speed 0", "--speed: expected 0.01 … 100, got '0'"),
        ("runs export 1 -o a.mp4 --last -1", "--last: expected 0 or more, got '-1'"),
        (f"runs rename 1 {'x' * 201}", "runs: expected at most 200 characters, got 'xxx"),
        ("import x --first-index 1.5", "--first-index: expected one of 0, 1, got '1.5'"),
        ("import x --axes opengl_", "got 'opengl_'; did you mean \"opengl\"?"),
        ("import x --up None", "--up: expected one of x, y, z, -x, -y, -z, got 'None'"),
        ("serve --port http", "--port: expected a whole number, got 'http'"),
        ("batch x --seeds two", "--seeds: expected a whole number, got 'two'"),
        ("templates remove x abc", "templates: expected a whole number, got 'abc'"),
    ],
)
def test_a_word_that_does_not_fit_is_one_sentence_with_its_flag(
    run: Runs, line: str, words: str
) -> None:
    status, stdout, stderr = run(*line.split())
    assert (status, stdout, stderr.count("\n")) == (2, "", 1)
    assert re.search(re.escape(words).replace(r"\.\*", ".*"), stderr), stderr


def test_the_version(run: Runs) -> None:
    assert run("--version") == (0, f"multiview-phd {__version__}\n", "")


def test_an_unknown_ending_is_told_before_anything_is_done(run: Runs, tmp_path: Path) -> None:
    status, stdout, stderr = run("track", "room44-3p", "-o", tmp_path / "tracks.xyz")
    assert (status, stdout, stderr.count("\n")) == (1, "", 1)
    assert "ends in one of .csv, .json, .parquet, .trc, .glb, .rrd, .html, .mp4" in stderr
    assert not (tmp_path / "tracks.xyz").exists()


@pytest.mark.full
def test_a_failure_is_one_line(
    run: Runs, crossing: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(compilation, "is_compiled", lambda: True)  # else that is told as well
    broken = write_crossing(tmp_path / "broken", 5)
    (broken / "right.csv").write_text("frame,left,top\n0,1,2\n")
    out = tmp_path / "x.csv"
    for arguments, words in [
        ((broken, "-o", out), "right.csv"),
        ((tmp_path / "nowhere", "-o", out), "nowhere"),
        (("nonsense", "-o", out), 'no sequence "nonsense"'),
        ((crossing, "-o", tmp_path), "expected a file to write, found a folder"),
        ((crossing, "-o", tmp_path / "no" / "x.csv"), "there is no folder"),
        ((crossing, "-o", out, "--single-view", "colour_phd"), "pictures"),
    ]:
        status, stdout, stderr = run("track", *arguments)
        assert (status, stdout) == (1, "")
        assert words in stderr
        assert stderr.startswith("multiview-phd: ")
        assert stderr.count("\n") == 1
        assert not out.exists()


@pytest.mark.full
def test_a_surprise_is_one_line_too_unless_asked(
    run: Runs, crossing: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: Any, **__: Any) -> Run:
        raise RuntimeError("a bug")

    monkeypatch.setattr(pipeline, "compute", fail)
    status, _, stderr = run("track", crossing, "-o", tmp_path / "x.csv")
    assert status == 1
    assert (
        stderr.strip().splitlines()[-1].startswith("multiview-phd: unexpected RuntimeError: a bug")
    )
    monkeypatch.setenv(cli.TRACEBACK, "1")
    with pytest.raises(RuntimeError, match="a bug"):
        run("track", crossing, "-o", tmp_path / "x.csv")


def test_a_failure_leaves_an_older_file_as_it_was(
    run: Runs, crossing: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "tracks.csv"
    out.write_text("older")

    def interrupt(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(tracks_csv, "write_tracks_csv", interrupt)
    status, _, stderr = run("track", crossing, "-o", out)
    assert status == 130
    assert stderr.strip().splitlines()[-1] == "multiview-phd: interrupted; nothing was written"
    assert out.read_text() == "older"
    assert list(tmp_path.iterdir()) == [out]


@pytest.mark.full
def test_ctrl_c_in_the_middle_leaves_nothing(tmp_path: Path) -> None:
    folder = write_crossing(tmp_path / "long", 6000)
    out = tmp_path / "out"
    out.mkdir()
    process = subprocess.Popen(
        [sys.executable, "-c", BARRED, "track", str(folder), "-o", str(out / "tracks.csv")],
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "computing\n"
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert err.strip().splitlines()[-1] == "multiview-phd: interrupted; nothing was written"
    assert "Traceback" not in err
    assert not list(out.iterdir())


def test_ctrl_c_inside_a_compiled_kernel(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Compiled code hands an interruption on as a failure that it caused, some levels down."""

    def heard(_: object) -> int:
        try:
            try:
                raise KeyboardInterrupt
            except KeyboardInterrupt as interruption:
                raise SystemError("unpickle: result with an exception") from interruption
        except SystemError as error:
            raise SystemError("update: result with an exception") from error

    monkeypatch.setattr(cli, "run", heard)
    assert cli.main(["parameters"]) == 130
    assert capsys.readouterr().err == "multiview-phd: interrupted; nothing was written\n"


BARRED = """
import sys
from app.command import main as cli
from tracker.runs import pipeline
real = pipeline.compute
def compute(*args, on_progress, **kwargs):
    told = []
    def tell(run, progress):
        if progress.done and not told:
            told.append(1)
            print("computing", flush=True)
        on_progress(run, progress)
    return real(*args, on_progress=tell, **kwargs)
pipeline.compute = compute
sys.exit(cli.main())
"""
"""The command line, saying when the first steps are there."""


@pytest.mark.parametrize(
    ("command", "instead"),
    [("render", "tests.rooms NAME -o FOLDER"), ("experiment", "tests.papers")],
)
def test_a_command_of_before_says_what_replaces_it(run: Runs, command: str, instead: str) -> None:
    status, _, stderr = run(command, "random-7")
    assert status == 2
    assert f"the program no longer has this command; run `python -m {instead}" in stderr


def test_sequences(run: Runs, data: Path) -> None:
    status, stdout, stderr = run("sequences", "--data", data)
    assert (status, stderr) == (0, "")
    rows = {line.split()[0]: line for line in stdout.splitlines()}
    assert rows["name"].split() == ["name", "kind", "cameras", "steps", "description"]
    assert {"room24-2p", "room35-2p", "room44-3p", "crossing", "numbers"} <= set(rows)
    assert rows["crossing"].split()[1:4] == ["folder", "3", "120"]
    assert run("sequences", "--data", data / "nowhere")[0] == 1


def test_parameters(run: Runs) -> None:
    status, stdout, stderr = run("parameters")
    assert (status, stderr) == (0, "")
    assert max(map(len, stdout.splitlines())) < 80, "what is no terminal has 80 columns"
    entries = [" ".join(text.split()) for text in re.split(r"\n(?! )", stdout.rstrip())]
    table = {text.split()[0]: text for text in entries}
    assert set(table) == {*PARAMETERS, *METHODS}
    for key, parameter in PARAMETERS.items():
        assert parameter.symbol in table[key]
        assert table[key].endswith(" ".join(parameter.help.split()))
        if parameter.minimum is not None:
            assert f"{parameter.minimum:g} … {parameter.maximum:g}" in table[key]
    rows = json.loads(run("parameters", "--json")[1])
    assert [row["key"] for row in rows] == [*METHODS, *PARAMETERS]
    assert {row["key"]: row["help"] for row in rows}[P_D] == PARAMETERS[P_D].help


def test_changes_of_a_flag_beat_those_of_a_preset() -> None:
    key, published = next(iter(PRESETS["published"].items()))
    other = PARAMETERS[key].default
    assert other != published
    flag = "--" + key.replace("_", "-")
    command = parse(["track", "r", "-o", "x", "--preset", "published", flag, str(other)])
    assert isinstance(command, Track)
    assert command.changes()[key] == str(other)
    with pytest.raises(ParameterError):
        Track(sequence="r", output=Path("x"), preset="magic").changes()


def test_presets_of_ones_own_are_taken_by_name(
    run: Runs, crossing: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MULTIVIEW_PHD_SETTINGS", str(tmp_path))
    values = {P_D: 0.9, "fusion.recognition_doubt": 0.25}
    keep_preset(tmp_path / "presets.json", "tuned", values)
    keep_preset(tmp_path / "presets.json", "other", {"fusion.process_noise": 0.1})
    current = {P_D: 0.9, "fusion.recognition_outlier_probability": 0.25}
    command = parse(["track", "r", "-o", "x", "--preset", "tuned"])
    assert command.changes() == current
    taken: list[Any] = []
    monkeypatch.setattr(
        studies, "run_batch", lambda _, changes, *__, **___: taken.append(changes) or []
    )
    run("batch", crossing, "--preset", "tuned", "--library", tmp_path / "library.sqlite3")
    assert taken == [current]
    status, _, stderr = run("batch", crossing, "--preset", "magic")
    assert status == 2
    assert '--preset: expected one of robust, published, tuned, other, found "magic"' in stderr
    gone = next(iter(REMOVED))
    keep_preset(tmp_path / "presets.json", "tuned", {P_D: 0.9, gone: 1.0})
    with_values(RunParameters(), command.changes())
    _, _, stderr = run("batch", crossing, "--preset", "tuned", "--set", "fusion.nothing=1")
    assert f"{gone} no longer exists" in stderr
    (tmp_path / "presets.json").write_text('{"tuned": 3}')
    _, _, stderr = run("batch", crossing, "--preset", "tuned")
    assert f"{tmp_path / 'presets.json'}: tuned: expected an object, found 3" in stderr


def test_a_batch_takes_the_methods_as_track_does(
    run: Runs, crossing: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    taken: list[Any] = []
    monkeypatch.setattr(
        studies, "run_batch", lambda _, changes, *__, **___: taken.append(changes) or []
    )
    flags = ["--single-view", "jpda", "--fusion", "sequential_phd", "--smoothing", "none"]
    flags += ["--set", "fusion_method=association_matrix"]
    assert run("batch", crossing, *flags, "--library", tmp_path / "library.sqlite3")[0] == 0
    assert taken == [parse(["track", "r", "-o", "x", *flags]).changes()]
    assert taken[0] == {
        "fusion_method": "sequential_phd", "single_view": "jpda", "smoothing_method": "none",
    }  # fmt: skip
    status, _, stderr = run("batch", crossing, "--fusion", "magic")
    assert (status, "expected one of" in stderr) == (2, True)


def test_checks_as_json_say_what_the_table_says(run: Runs, tmp_path: Path) -> None:
    folder = write_crossing(tmp_path / "crossing", frames=20)
    file = folder / "sequence.toml"
    text = re.sub(r"\[target\]\n.*\n", "", file.read_text(encoding="utf-8"))
    file.write_text(text, encoding="utf-8")
    status, table, _ = run("check", folder)
    rows = json.loads(run("check", folder, "--json")[1])
    assert [row["check"] for row in rows][-1] == "opening"
    lines = table.splitlines()[1:]
    assert len(rows) == len(lines) > 5
    for row, line in zip(rows, lines, strict=True):
        assert line.startswith({"good": "ok", "warning": "!", "absent": "–"}[row["status"]])
        assert line.endswith(row["found"])
    assert run("check", folder, "--json")[0] == status == 1


def test_cameras_that_see_nothing_are_named_once(run: Runs, tmp_path: Path) -> None:
    folder = write_crossing(tmp_path / "crossing", frames=20)
    file = folder / "sequence.toml"
    text = file.read_text(encoding="utf-8")
    text = re.sub(r"min = .*", "min = [500.0, 500.0, 0.0]", text)
    file.write_text(re.sub(r"max = .*", "max = [504.0, 504.0, 2.0]", text), encoding="utf-8")
    checked = run("check", folder)[1]
    tracked = run("track", folder, "-o", tmp_path / "tracks.csv")[2]
    assert checked.count("nothing of the room") == tracked.count("nothing of the room") == 1


@pytest.mark.full
def test_a_batch_goes_on_without_a_recording_that_is_missing(
    run: Runs, crossing: Path, tmp_path: Path
) -> None:
    line = ("batch", "absent", crossing, "--workers", 1, "--library", tmp_path / "library.sqlite3")
    status, stdout, stderr = run(*line)
    assert status == 1
    _, missing, done = stdout.splitlines()
    assert re.fullmatch(r"absent +0 .*there is no sequence \"absent\": expected .*", missing)
    assert re.match(r"crossing +1 ", done)
    assert "1 of 2 runs stored, 1 of them computed now" in stderr


def test_help_is_there_at_once_and_without_the_engine() -> None:
    script = (
        "import sys; from app.command import main as cli\n"
        "try: cli.main(['--help'])\n"
        "except SystemExit: pass\n"
        "assert not {'numba', 'scipy', 'cv2', 'fastapi', 'viser'} & set(sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    for command in ("serve", "track", "sequences", "parameters"):
        assert command in done.stdout


@pytest.mark.full
def test_python_m_app_is_the_same_program() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "app", "parameters"], capture_output=True, text=True
    )
    assert done.returncode == 0
    assert P_D in done.stdout
    done = subprocess.run([sys.executable, "-m", "app", "fly"], capture_output=True, text=True)
    assert done.returncode == 2


def test_whoever_has_read_enough_is_no_failure() -> None:
    done = subprocess.run(
        f"{sys.executable} -m app parameters | head -n 1",
        shell=True,
        capture_output=True,
        text=True,
    )
    assert done.stderr == ""
    assert done.stdout.startswith("single_view")


@pytest.mark.full
def test_whoever_reads_nothing_is_no_failure() -> None:
    # what is short waits in a buffer, and would only be missed at the interpreter's end
    buffered = {name: text for name, text in os.environ.items() if name != "PYTHONUNBUFFERED"}
    line = f"{sys.executable} -m app sequences | true"
    done = subprocess.run(line, shell=True, capture_output=True, text=True, env=buffered)
    assert done.stderr == ""


@pytest.mark.parametrize("port", ["-1", "65536", "99999999"])
def test_a_port_that_cannot_be_is_wrong_usage(run: Runs, port: str) -> None:
    status, stdout, stderr = run("serve", "--port", port)
    assert (status, stdout) == (2, "")
    assert f"--port: expected 0 (any that is free) to 65535, got {port}" in stderr


@pytest.mark.parametrize("size", ["-0.1", "65537"])
def test_a_limit_of_the_cache_that_cannot_be_is_wrong_usage(run: Runs, size: str) -> None:
    status, stdout, stderr = run("serve", f"--disk={size}")
    assert (status, stdout) == (2, "")
    assert f"--disk: expected 0 to 65536 GB, got {size}" in stderr


def test_a_new_study_seeks_what_its_recording_can_tell(
    run: Runs, crossing: Path, tmp_path: Path
) -> None:
    bare = tmp_path / "bare"
    shutil.copytree(crossing, bare)
    file = bare / "sequence.toml"
    text = file.read_text(encoding="utf-8")
    truth = '[ground_truth]\nfile = "truth.csv"'
    assert truth in text
    file.write_text(text.replace(truth, ""), encoding="utf-8")
    for recording, objective in [(crossing, "score"), (bare, "identity"), ("absent", "score")]:
        study = tmp_path / f"{objective}-{Path(recording).name}.toml"
        assert run("study", "new", study, "--recording", recording)[0] == 0
        assert f'objectives = ["{objective}"]' in study.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("name", "written"),
    [
        ("Data/x", "../Data/x"),
        ("./Data/*/", "../Data/*"),
        ("studies/y", "y"),
        ("studies/room44-3p", "./room44-3p"),
        ("../far/z", "{parent}/far/z"),
        ("room44-3p", "room44-3p"),
        ("absent", "absent"),
    ],
)
def test_a_new_study_names_its_recording_as_seen_from_its_file(
    run: Runs, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, written: str
) -> None:
    home = tmp_path / "home"
    for place in ("Data/x", "studies/y", "studies/room44-3p", "../far/z"):
        write_crossing(home / place, frames=2)
    monkeypatch.chdir(home)
    assert run("study", "new", "studies/s.toml", "--recording", name)[0] == 0
    text = (home / "studies" / "s.toml").read_text(encoding="utf-8")
    assert f'recordings = ["{written.format(parent=tmp_path)}"]' in text
    if name != "absent":
        read_definition(Path("studies/s.toml"))


@pytest.mark.parametrize(
    ("line", "option", "values"),
    [
        (
            ["track", "room", "-o", "a.csv"],
            "set",
            ("fusion.clutter_rate=2", "fusion.motion=random_walk"),
        ),
        (["batch", "room"], "set", ("fusion.clutter_rate=2", "fusion.motion=random_walk")),
        (["tune", "room"], "set", ("fusion.clutter_rate=2", "fusion.motion=random_walk")),
        (["study", "new", "study.toml"], "recording", ("one", "other")),
    ],
)
def test_an_option_given_twice_loses_neither(
    line: list[str], option: str, values: tuple[str, ...]
) -> None:
    given = [word for one in values for word in (f"--{option}", one)]
    command: Any = parse([*line, *given])
    assert getattr(getattr(command, "action", command), option) == values


def test_a_recording_of_any_name_is_tuned(
    run: Runs, crossing: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(crossing, recording := tmp_path / "Hall (north) [2] & yard")
    monkeypatch.setattr(studies, "run", lambda *_, **__: studies.INTERRUPTED)
    status, _, stderr = run("tune", f"{recording}/", "--studies", tmp_path / "studies")
    assert (status, "study resume 'tune Hall -north- -2- - yard 1'" in stderr) == (130, True)
