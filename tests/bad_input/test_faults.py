"""Some of the trials of :mod:`tests.bad_input.faults`, so that the command keeps working."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from tests.bad_input import faults


@pytest.mark.full
@pytest.mark.skipif(sys.platform == "win32", reason="there are no such signals and mounts")
def test_nothing_is_lost_and_trials_go_on_where_they_ended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "trials.jsonl"
    for trials in (1, 3):
        arguments = ["faults", str(file), "--trials", str(trials), "--seed", "7"]
        monkeypatch.setattr(sys, "argv", arguments)
        assert faults.main() == 0, file.read_text()
        told = [json.loads(line) for line in file.read_text().splitlines()]
        assert [one["trial"] for one in told] == list(range(trials))
