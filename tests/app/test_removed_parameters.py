"""Presets, flags and addresses that name a parameter that no longer exists."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient

from app.command.flags import parse
from app.state.edits import Edits
from app.state.presets import OwnPresets
from app.state.snapshot import Notice
from app.state.workbench import Workbench
from tests.app.conftest import command
from tests.parameters.test_values import GONE, MEANT, NOTES
from tracker.files.validated import write_json
from tracker.parameters.values import changed_values


def notices(workbench: Workbench) -> list[str]:
    """The sentences that the workbench says from now on."""
    said: list[str] = []

    def listen(event: Any) -> None:
        if isinstance(event, Notice):
            said.append(event.message)

    workbench.subscribe_events(listen)
    return said


def test_a_saved_preset_is_taken_without_them_and_says_so(tmp_path: Path) -> None:
    path = tmp_path / "presets.json"
    write_json(path, {"mine": {**GONE, **MEANT}})
    workbench = Workbench()
    own = OwnPresets(workbench, Edits(workbench), path)
    own.rename("mine", "ours")  # they are still in the file
    again = Workbench()
    OwnPresets(again, Edits(again), path)
    said = notices(again)
    again.apply_preset("ours")
    assert changed_values(again.snapshot().parameters) == MEANT
    assert again.snapshot().preset == "ours"
    assert tuple(said) == NOTES


def test_the_page_of_an_older_address_gets_the_rest_and_a_note(client: TestClient) -> None:
    said = notices(client.app.state.workbench)  # type: ignore[attr-defined]
    answer = command(client, "set_parameters", changes={**GONE, **MEANT})
    assert answer.status_code == 200
    assert MEANT.items() <= answer.json()["parameters"].items()
    assert tuple(said) == NOTES
    answer = command(client, "reset_parameters", keys=[*GONE, *MEANT])
    assert not MEANT.keys() & set(answer.json()["changed"])


@pytest.mark.parametrize("mark", ["-", "_"])
@pytest.mark.parametrize("apart", [True, False])
def test_flags_and_set_say_so_and_the_rest_counts(
    mark: str, apart: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    flags = [f"--{key.replace('_', mark)}={value}" for key, value in GONE.items()]
    if apart:
        flags = [part for flag in flags for part in flag.split("=")]
    command: Any = parse(
        ["track", "room24-2p", *flags, "--fusion.clutter-rate", "0.25", "-o", "tracks.csv"]
    )
    assert command.changes() == {"fusion.clutter_rate": "0.25"}
    assert capsys.readouterr().err.splitlines() == [f"multiview-phd: {note}" for note in NOTES]
