"""The check of identities without truth, through the routes: begun, watched, listed, stopped."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient

from app.state import tasks
from app.state.workbench import Workbench
from tests.app.conftest import command, wait_until
from tracker.review.self_consistency import Estimate
from tracker.runs import pipeline
from tracker.runs.pipeline import Run
from tracker.sequences.library import open_sequence


@pytest.mark.full
def test_a_finished_run_is_looked_at_in_other_ways(client: TestClient) -> None:
    assert client.get("/api/identity").json()["score"] is None
    begun = client.post("/api/identity").json()
    assert begun["state"] in ("looking", "done")
    wait_until(lambda: client.get("/api/identity").json()["state"] == "done", 60.0)
    told = client.get("/api/identity").json()
    state = client.get("/api/state").json()
    assert told["run"] == state["run"]["key"]
    assert 0.0 <= told["low"] <= told["high"] <= 1.0
    names = [camera["name"] for camera in state["sequence"]["cameras"]]
    assert [witness["camera"] for witness in told["witnesses"]] == names
    mean = sum(witness["agreed"] for witness in told["witnesses"]) / len(names)
    assert told["score"] == told["backwards"] * mean
    assert "consistently wrong" in told["warning"]
    assert all(doubt["why"] for doubt in told["doubts"])
    # asked for again it is there already
    assert client.post("/api/identity").json()["state"] == "done"


def test_a_run_that_is_not_finished_is_not_checked(crossing: Path) -> None:
    sequence = open_sequence(str(crossing))
    parameters = pipeline.default_parameters(sequence)
    check = tasks.IdentityCheck(Workbench())
    with pytest.raises(ValueError, match="3 of 120 steps"):
        check.start(pipeline.compute(sequence, parameters, steps=3))
    assert check.now.state == "idle"


def test_another_run_ends_a_check(own_client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    stopped: list[str] = []

    def endless(run: Run, *, cancelled: Callable[[], bool], **_: Any) -> Estimate:
        wait_until(cancelled, 30.0)
        stopped.append(run.key)
        raise tasks.Cancelled

    monkeypatch.setattr(tasks, "estimate", endless)
    key = own_client.post("/api/identity").json()["run"]
    command(own_client, "set_parameters", changes={"fusion.detection_probability": 0.7})
    wait_until(lambda: own_client.get("/api/identity").json()["state"] == "cancelled")
    wait_until(lambda: stopped == [key])


def test_who_stops_a_check_does_not_wait_for_its_processes(
    own_client: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    begins, ends = threading.Event(), threading.Event()
    left: list[str] = []

    def slow_to_hear(run: Run, *, on_progress: Callable[[int, int], None], **_: Any) -> Estimate:
        begins.set()
        assert ends.wait(30.0)
        left.append(run.key)
        on_progress(1, 1)
        return Estimate(1.0, 1.0, (), (), ())

    monkeypatch.setattr(tasks, "estimate", slow_to_hear)
    key = own_client.post("/api/identity").json()["run"]
    assert begins.wait(30.0)
    assert own_client.delete("/api/identity").json()["state"] == "cancelled"
    worker = next(one for one in threading.enumerate() if one.name == "identity")
    ends.set()
    worker.join(30.0)
    assert left == [key]
    told = own_client.get("/api/identity").json()
    assert (told["state"], told["score"], told["done"]) == ("cancelled", None, 0)
