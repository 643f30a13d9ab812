"""The socket to the pages: what is told, in which order, and what never is."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable
from typing import Any

import pytest
from starlette.testclient import TestClient

from app.state.workbench import Workbench
from tests.app.conftest import command, connect, run_is, wait_until
from tracker import smoothing

P_D = "fusion.detection_probability"
Message = dict[str, Any]


def read_until(socket: Any, last: Callable[[Message], bool]) -> list[Message]:
    """All messages up to the first one that is the awaited."""
    messages: list[Message] = []
    while not messages or not last(messages[-1]):
        messages.append(socket.receive_json())
        assert len(messages) < 2000
    return messages


def is_type(kind: str) -> Callable[[Message], bool]:
    return lambda message: message["type"] == kind


def test_a_page_is_told_everything_when_it_comes(client: TestClient) -> None:
    client.post("/api/seek", json={"step": 40})
    with connect(client) as socket:
        messages = read_until(socket, is_type("timeline"))
    told = {message["type"]: message for message in messages}
    assert set(told) == {"playhead", "state", "step", "evaluation", "tasks", "timeline"}
    assert told["playhead"]["step"] == 40
    assert told["state"]["state"] == client.get("/api/state").json()
    step = {k: v for k, v in told["step"].items() if k != "type"}
    assert step == client.get("/api/step/40").json()
    assert told["timeline"]["done"] == 120


def test_work_in_the_background_is_told_until_it_is_over(client: TestClient) -> None:
    with connect(client) as socket:
        read_until(socket, is_type("timeline"))
        number = str(client.post("/api/exports", json={"format": "csv"}).json()["number"])

        def over(message: Message) -> bool:
            now = message.get("tasks", {}).get("export", {})
            return bool(now.get("of") == number and now["state"] == "done")

        messages = read_until(socket, over)
    assert messages[-1]["tasks"]["export"]["words"].endswith(".csv")
    assert not any(message["type"] == "state" for message in messages), "nothing else is told anew"


def test_a_page_that_comes_later_is_told_of_the_studies_that_run(client: TestClient) -> None:
    bench: Workbench = client.app.state.workbench  # type: ignore[attr-defined]
    for name, state in (("long", "running"), ("short", "running"), ("short", "done")):
        bench.study_changed({"name": name, "state": state, "done": 3})
    with connect(client) as socket:
        messages = read_until(socket, is_type("timeline"))
    told = [message["study"]["name"] for message in messages if message["type"] == "study"]
    assert told == ["long"]
    bench.study_changed({"name": "long", "state": "done", "done": 3})


def test_a_seek_reaches_every_page(client: TestClient) -> None:
    with (
        connect(client) as one,
        connect(client) as other,
    ):
        for socket in (one, other):
            read_until(socket, is_type("timeline"))
        one.send_json({"type": "seek", "step": 77, "origin": "one"})
        for socket in (one, other):
            playhead, step = read_until(socket, is_type("step"))
            assert playhead == {"type": "playhead", "step": 77, "origin": "one"}
            assert step["step"] == 77
            assert step["computed"]


def test_selection_and_layers_reach_the_page_in_the_state(client: TestClient) -> None:
    with connect(client) as socket:
        read_until(socket, is_type("timeline"))
        socket.send_json({"type": "select", "id": 3})
        assert socket.receive_json()["state"]["selection"] == 3
        client.patch("/api/layers", json={"changes": {"trails": False}})
        assert not socket.receive_json()["state"]["layers"]["trails"]


def test_ping(client: TestClient) -> None:
    with connect(client) as socket:
        read_until(socket, is_type("timeline"))
        socket.send_json({"type": "ping"})
        assert socket.receive_json() == {"type": "pong"}


def test_what_is_not_understood_is_said_and_harms_nothing(client: TestClient) -> None:
    with connect(client) as socket:
        read_until(socket, is_type("timeline"))
        for text in (
            "garbage",
            "[]",
            '{"type":"seek"}',
            '{"type":"seek","step":"x"}',
            '{"type":"launch"}',
            json.dumps({"type": "seek", "step": 1, "origin": "x" * 20000}),
        ):
            socket.send_text(text)
            notice = socket.receive_json()
            assert (notice["type"], notice["level"]) == ("notice", "warn")
        socket.send_bytes(b"\x00")
        assert socket.receive_json()["type"] == "notice"
        socket.send_json({"type": "seek", "step": 2})
        assert read_until(socket, is_type("step"))[-1]["step"] == 2


@pytest.mark.full
def test_a_changed_parameter_ends_in_the_step_of_its_own_run(client: TestClient) -> None:
    with connect(client) as socket:
        read_until(socket, is_type("timeline"))
        client.post("/api/seek", json={"step": 100})
        read_until(socket, is_type("step"))
        for number in range(10):
            command(client, "set_parameters", changes={P_D: 0.7 + 0.01 * number})
        wanted = client.get("/api/state").json()["run"]["key"]
        messages = read_until(
            socket,
            lambda m: m["type"] == "timeline" and m["run"] == wanted and m["done"] == 120,
        )
        steps = [m for m in messages if m["type"] == "step"]
        assert steps[-1]["run"] == wanted
        assert steps[-1]["computed"]
        assert all(m["step"] == 100 for m in steps)
        assert all(not m["tracks"] for m in steps if not m["computed"])
        states = [m["state"] for m in messages if m["type"] == "state"]
        assert states[-1]["run"]["key"] == wanted
        versions = [state["version"] for state in states]
        assert versions == sorted(versions)
    wait_until(run_is(client, "done"))


@pytest.mark.full
def test_a_step_is_told_again_when_hindsight_has_replaced_its_people(
    client: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    told, make = threading.Event(), smoothing.create

    def after_it_was_told(*args: Any) -> Any:
        assert told.wait(30.0)
        return make(*args)

    monkeypatch.setattr(smoothing, "create", after_it_was_told)
    with connect(client) as socket:
        read_until(socket, is_type("timeline"))
        client.post("/api/seek", json={"step": 100})
        command(client, "set_parameters", changes={P_D: 0.7})
        wanted = client.get("/api/state").json()["run"]["key"]

        def is_step(message: Message) -> bool:
            return message["type"] == "step" and message["run"] == wanted and message["computed"]

        before = read_until(socket, is_step)[-1]
        told.set()
        after = read_until(socket, lambda m: is_step(m) and m["revision"] > 0)[-1]
    assert before["revision"] == 0
    assert after["tracks"] != before["tracks"]
    assert after["tracks"] == client.get("/api/step/100").json()["tracks"]


def test_keys_pressed_in_3d_and_notices_are_relayed(client: TestClient) -> None:
    bench = client.app.state.workbench  # type: ignore[attr-defined]
    with connect(client) as socket:
        read_until(socket, is_type("timeline"))
        bench.command("play")
        assert socket.receive_json() == {"type": "command", "name": "play"}
        bench.notify("info", "hello", "nothing")
        assert socket.receive_json() == {
            "type": "notice",
            "level": "info",
            "message": "hello",
            "hint": "nothing",
        }


@pytest.mark.full
def test_a_failed_opening_is_told_to_a_page_that_comes_later(client: TestClient) -> None:
    client.post("/api/sequence", json={"name": "nonsense"})
    with connect(client) as socket:
        first = socket.receive_json()
    assert (first["type"], first["level"]) == ("notice", "error")
    assert "nonsense" in first["message"]
    client.post("/api/sequence", json={"name": "numbers"})
    wait_until(lambda: client.get("/api/state").json()["sequence"]["name"] == "numbers")
    with connect(client) as socket:
        assert socket.receive_json()["type"] == "playhead"


def test_the_3d_view_jumps_while_somebody_wants_less_motion(client: TestClient) -> None:
    bench: Workbench = client.app.state.workbench  # type: ignore[attr-defined]
    with connect(client) as other:
        other.send_json({"type": "motion", "flies": True})
        with connect(client) as socket:
            socket.send_json({"type": "motion", "flies": False})
            wait_until(lambda: not bench.snapshot().flies)
            bench.look(None)  # a click inside the 3D view: it does not say whose
            assert not bench.snapshot().flies
        wait_until(lambda: bench.snapshot().flies)
