"""``multiview-phd experiment``: names, folders, what is left out, and the short form of all."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from app.command import main as cli
from tests.conftest import DATA
from tracker.experiments import EXPERIMENTS, Context, Experiment, Finding, Result, Unavailable


def run(*arguments: object) -> int:
    try:
        return cli.main(["experiment", *map(str, arguments)])
    except SystemExit as stop:
        return int(stop.code or 0)


def works(context: Context) -> Result:
    context.told("working", 1, 1)
    found = Finding("it works", f"quick {context.quick}, data {context.data}", "better")
    return Result(("name", ">value"), (("a", "1"),), {"a": 1}, (found,), notes=("A note.",))


def is_missing(context: Context) -> Result:
    raise Unavailable("the recording is not at hand; name its folder: --data DIR")


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two experiments that take no time."""
    for name in list(EXPERIMENTS):
        monkeypatch.delitem(EXPERIMENTS, name)
    for name, function in (("missing", is_missing), ("works", works)):
        monkeypatch.setitem(EXPERIMENTS, name, Experiment(name, f"{name}, they say.", function))


def test_without_a_name_they_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert run() == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == ["name", "claim"]
    assert [line.split()[0] for line in lines[1:]] == list(EXPERIMENTS)


@pytest.mark.usefixtures("small")
def test_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("works", "--quick", "--output", tmp_path / "out", "--data", tmp_path) == 0
    captured = capsys.readouterr()
    assert captured.out.splitlines() == [
        "works: works, they say.",
        "",
        "name  value",
        "a         1",
        "",
        "A note.",
        f"better: claimed: it works; found: quick True, data {tmp_path}",
        "",
    ]
    assert captured.err.startswith("multiview-phd: works: 0 s, ")
    assert json.loads((tmp_path / "out" / "works.json").read_text())["quick"]


@pytest.mark.usefixtures("small")
def test_what_cannot_be_run_here(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("missing", "--output", tmp_path / "out") == 1
    assert capsys.readouterr().err == (
        "multiview-phd: missing: the recording is not at hand; name its folder: --data DIR\n"
    )
    assert not (tmp_path / "out").exists()
    assert run("--all", "--output", tmp_path / "out") == 0
    captured = capsys.readouterr()
    assert "missing is left out: the recording is not at hand" in captured.err
    assert captured.out.startswith("works: ")


@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [
        (["fig9"], 2, "NAME: expected one of fig1, fig2, fig3, "),
        (["fig1", "--all"], 2, "expected either a name or --all"),
        (["fig1", "--data", "/nowhere"], 1, "--data /nowhere: expected a folder, found none"),
        (["fig1", "--output", __file__], 1, "expected a folder, found a file"),
    ],
)
def test_wrong_usage(
    arguments: list[str], status: int, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(*arguments) == status
    err = capsys.readouterr().err
    assert words in err
    assert err.count("\n") == 1


@pytest.mark.full
def test_all_in_short_show_the_direction_of_each_claim(tmp_path: Path) -> None:
    data = ["--data", str(DATA)] if DATA.is_dir() else []
    done = subprocess.run(
        [sys.executable, "-m", "app", "experiment", "--all", "--quick", "--output", str(tmp_path),
         *data],
        cwd=Path(__file__).parents[2],
        env={**os.environ, "PYTHONWARNINGS": "error"},
        capture_output=True,
        text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    numbers: dict[str, Any] = {
        path.stem: json.loads(path.read_text(encoding="utf-8"))["numbers"]
        for path in tmp_path.glob("*.json")
    }
    for name in numbers:
        assert (tmp_path / f"{name}.png").stat().st_size > 10_000
    for person in numbers["fig1"]["people"].values():
        assert person["found_share"] > 0.7
        assert person["armchair_error"] < 0.3
    assert numbers["fig2"]["mean_overlap"] > 0.5
    groups = numbers["fig3"]["groups"]
    assert groups["without occlusion"]["scheme"] < 0.6 * groups["without occlusion"]["single"]
    assert groups["with occlusion"]["scheme"] < groups["with occlusion"]["single"]
    assert numbers["sequences"]["sequences"]["room44-3p"]["mota"] > 0.7
    if data:
        by_count = numbers["cameras"]["by_count"]
        assert by_count["3"]["ospa"] < by_count["2"]["ospa"] < by_count["1"]["ospa"]
        assert by_count["3"]["position_error"] < 0.44 * by_count["1"]["position_error"]
