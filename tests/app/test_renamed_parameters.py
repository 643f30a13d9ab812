"""Presets, flags and addresses that name a parameter as an earlier version did."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient

from app.command.flags import parse
from app.state.edits import Edits
from app.state.presets import OwnPresets
from app.state.workbench import Workbench
from tests.app.conftest import command
from tests.parameters.test_values import DEFAULTS, MEANT, OTHER
from tracker.files.validated import write_json
from tracker.parameters.catalogue import RENAMED
from tracker.parameters.values import changed_values, with_values


def test_a_saved_preset_has_the_names_of_now(tmp_path: Path) -> None:
    path = tmp_path / "presets.json"
    write_json(path, {"mine": OTHER})
    workbench = Workbench()
    own = OwnPresets(workbench, Edits(workbench), path)
    assert workbench.snapshot().presets == {"mine": MEANT}
    workbench.apply_preset("mine")
    assert changed_values(workbench.snapshot().parameters) == MEANT
    assert workbench.snapshot().preset == "mine"
    own.rename("mine", "ours")
    again = Workbench()
    assert OwnPresets(again, Edits(again), path)  # what was written is read again
    assert all(old not in path.read_text(encoding="utf-8") for old in RENAMED)


def test_values_are_set_and_reset_by_the_page_of_an_older_address(client: TestClient) -> None:
    state = command(client, "set_parameters", changes=OTHER).json()
    assert {key: state["parameters"][key] for key in MEANT} == MEANT
    state = command(client, "reset_parameters", keys=list(OTHER)).json()
    assert not set(MEANT) & set(state["changed"])


@pytest.mark.parametrize("mark", ["-", "_"])
def test_flags_of_earlier_versions_are_those_of_now(mark: str) -> None:
    flags = [f"--{old.replace('_', mark)}={value}" for old, value in OTHER.items()]
    command: Any = parse(["track", "room24-2p", "-o", "tracks.csv", *flags])
    assert changed_values(with_values(DEFAULTS, command.changes())) == MEANT
    apart = [part for flag in flags for part in flag.split("=")]
    again: Any = parse(["track", "room24-2p", "-o", "tracks.csv", *apart])
    assert again.changes() == command.changes()


def test_set_takes_old_keys_too_and_the_last_one_counts() -> None:
    given = [
        f"--set={key}={value}" for key, value in {**dict.fromkeys(MEANT, 0.2), **OTHER}.items()
    ]
    command: Any = parse(["track", "room24-2p", "-o", "tracks.csv", *given])
    assert changed_values(with_values(DEFAULTS, command.changes())) == MEANT
