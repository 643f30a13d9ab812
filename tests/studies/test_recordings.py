"""Which files a recording is made of, and which code a figure: what tells one run from another."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

import tracker
from tests.synthetic import write_sequence
from tracker.sequences.reader import FILE
from tracker.studies.jobs import FIGURES, figures_version
from tracker.studies.transfer import files_of


@pytest.mark.parametrize("words", [".", "./", "/", "", "**", "[", "..", "a**", "\\u0000"])
def test_a_word_that_is_no_file_is_no_part_of_a_recording(tmp_path: Path, words: str) -> None:
    folder = write_sequence(tmp_path / "room", frames=3, detections=True)
    before = files_of(folder)
    assert {path.name for path in before} >= {FILE, "cam1.csv"}
    file = folder / FILE
    lines = file.read_text(encoding="utf-8").splitlines()
    changed = [f'description = "{words}"' if a.startswith("description") else a for a in lines]
    assert changed != lines
    file.write_text("\n".join(changed), encoding="utf-8")
    assert files_of(folder) == before


def test_other_code_of_a_figure_is_another_version(tmp_path: Path) -> None:
    own = tmp_path / "tracker"
    for package in FIGURES:
        shutil.copytree(Path(tracker.__file__).parent / package, own / package)
    assert figures_version(own) == figures_version()
    for path in sorted(own.rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        path.write_text(f"{text}\nCHANGED = True\n", encoding="utf-8")
        figures_version.cache_clear()
        of_a_report = path.relative_to(own).as_posix().startswith("evaluation/report")
        assert (figures_version(own) == figures_version()) == of_a_report, path
        path.write_text(text, encoding="utf-8")
