"""``python -m tests.papers``: names, folders, and what is left out."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.papers.__main__ import main
from tests.papers.laboratory.experiment import Context, Experiment, Finding, Result, Unavailable
from tests.papers.registry import EXPERIMENTS


def run(*arguments: object) -> int:
    try:
        return main(list(map(str, arguments)))
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
    assert captured.err.startswith("tests.papers: working …\ntests.papers: works: 0 s, ")
    assert json.loads((tmp_path / "out" / "works.json").read_text())["quick"]


@pytest.mark.usefixtures("small")
def test_what_cannot_be_run_here(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("missing", "--output", tmp_path / "out") == 1
    assert capsys.readouterr().err == (
        "tests.papers: missing: the recording is not at hand; name its folder: --data DIR\n"
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
