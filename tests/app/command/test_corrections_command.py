"""``corrections`` in a terminal."""

from __future__ import annotations

from pathlib import Path

from tests.app.conftest import Runs


def test_a_recording_without_corrections_says_so(run: Runs, crossing: Path) -> None:
    status, out, err = run("corrections", "list", crossing)
    assert (status, out) == (0, "")
    assert "has no corrections yet; its log would be" in err
    assert run("corrections", "list", crossing, "--json")[:2] == (0, "[]\n")


def test_what_must_be_there_is_missed(run: Runs, crossing: Path, tmp_path: Path) -> None:
    status, _, err = run("corrections", "merge", crossing, crossing, "-o", tmp_path / "both.toml")
    assert status != 0
    assert "has no corrections yet" in err
    status, _, err = run("corrections", "list", tmp_path / "nowhere")
    assert status != 0
    assert "expected a corrections.toml or a sequence" in err
