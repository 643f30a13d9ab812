"""Which files a recording is made of, for those who send it or tell it from others."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.synthetic import write_sequence
from tracker.sequences.reader import FILE
from tracker.studies.workers.recordings import files_of


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
