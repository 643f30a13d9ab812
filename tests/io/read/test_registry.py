"""Formats of other packages, and two that claim the same file."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from tracker.io.read import registry
from tracker.io.read.pieces import FormatError
from tracker.io.read.protocol import Certainty
from tracker.io.read.source import SourceFile


@pytest.fixture(autouse=True)
def forget() -> Iterator[None]:
    """The list of formats is made anew before and after."""
    registry.all_formats.cache_clear()
    yield
    registry.all_formats.cache_clear()


def _install(monkeypatch: pytest.MonkeyPatch, added: object) -> None:
    point = SimpleNamespace(name="lab", value="lab.format", load=lambda: added)
    monkeypatch.setattr(registry, "entry_points", lambda group: [point])


def test_a_format_of_another_package_reads_its_files(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    lab = SimpleNamespace(
        NAME="the laboratory's",
        KIND="detections",
        SERIES=False,
        recognise=lambda file: Certainty.SURE if file.head.startswith(b"LAB") else Certainty.NO,
        read=lambda file: iter(()),
    )
    _install(monkeypatch, lab)
    (tmp_path / "a.lab").write_bytes(b"LAB 1")
    found, certainty, _ = registry.recognise(SourceFile(tmp_path / "a.lab"))
    assert (found, certainty) == (lab, Certainty.SURE)


def test_what_is_no_format_is_told_by_its_name(monkeypatch: pytest.MonkeyPatch) -> None:
    _install(monkeypatch, SimpleNamespace(NAME="half"))
    with pytest.raises(FormatError, match=r"lab\.format.*KIND.*expected NAME, KIND, SERIES"):
        registry.all_formats()


def test_a_format_for_the_version_before_gets_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    def load() -> object:
        raise ModuleNotFoundError("No module named 'tracker.formats'")

    point = SimpleNamespace(name="lab", value="lab.format", load=load)
    monkeypatch.setattr(registry, "entry_points", lambda group: [point])
    with pytest.raises(
        FormatError, match=r"No module named 'tracker\.formats'.*TreeFormat"
    ) as told:
        registry.all_formats()
    assert "\n" not in str(told.value)


def test_every_format_has_a_name_of_its_own() -> None:
    names = [one.NAME for one in registry.FORMATS]
    assert len(set(names)) == len(names)
    assert all(one.recognise.__doc__ and one.read.__doc__ for one in registry.FORMATS)


def test_a_reader_that_stumbles_says_only_that_the_file_is_not_its_own(tmp_path: Path) -> None:
    def stumble(file: SourceFile) -> Certainty:
        raise ZeroDivisionError("division by zero")

    lab = SimpleNamespace(NAME="a lab's own", KIND="detections", SERIES=False, recognise=stumble)
    (tmp_path / "a.lab").write_bytes(b"lab 1")
    found, _, complaint = registry.recognise(SourceFile(tmp_path / "a.lab"), [lab])
    assert found is None
    assert "a.lab: expected what a lab's own has, found" in str(complaint)
    assert "division by zero" in str(complaint)
