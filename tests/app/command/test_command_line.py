"""The command that the page shows computes what the page shows."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest
from starlette.testclient import TestClient

from app.command.flags import Track, parse
from tests.app.conftest import Runs, command, run_is, wait_until
from tracker.parameters.catalogue import PARAMETERS, RunParameters
from tracker.parameters.values import value_of, with_values


@pytest.mark.full
def test_it_gives_the_same_file(client: TestClient, run: Runs, tmp_path: Path) -> None:
    changes = {"fusion.detection_probability": 0.9, "fusion_method": "sequential_phd"}
    state = command(client, "set_parameters", changes=changes).json()
    wait_until(run_is(client, "done"))
    program, *arguments = shlex.split(state["command"])
    assert program == "multiview-phd"
    arguments[arguments.index("-o") + 1] = str(tmp_path / "tracks.csv")
    assert run(*arguments)[0] == 0
    written = (tmp_path / "tracks.csv").read_text(encoding="utf-8")
    assert written == client.get("/api/export/tracks.csv").text


def test_every_value_goes_the_way_there_and_back(client: TestClient) -> None:
    before = client.get("/api/state").json()["parameters"]
    changes = {}
    for key, parameter in PARAMETERS.items():
        if parameter.kind == "bool":
            changes[key] = not before[key]
        elif parameter.kind == "choice":
            changes[key] = parameter.choices[-1]
        else:
            changes[key] = parameter.maximum
    client.post("/api/run/cancel")
    state = command(client, "set_parameters", changes=changes).json()
    client.post("/api/run/cancel")
    wish = parse(shlex.split(state["command"])[1:])
    assert isinstance(wish, Track)
    told = {key: value for key, value in wish.changes().items() if key in before}
    assert set(told) == set(state["changed"]) & set(before)
    taken = with_values(RunParameters(), told)
    for key in told:
        assert value_of(taken, key) == state["parameters"][key], key
