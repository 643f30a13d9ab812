"""What the client did wrong is the client's to mend: a sentence, and never a failure of ours."""

from __future__ import annotations

import errno
import json
from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient

from app.web.access import security
from tests.app.conftest import command
from tracker.parameters.catalogue import METHODS, PARAMETERS

HUGE = [2**63, -(2**63) - 1, 10**400]
IMPOSSIBLE = ["a\0b", "x" * 300, "x" * 4096, "~nosuch", "~nosuch/x", "/" + "a/" * 1600]
NAMES = [*IMPOSSIBLE, "/dev/zero", "\x1b[2J"]


def refused(answer: Any) -> dict[str, Any]:
    assert 400 <= answer.status_code < 500, answer.text[:300]
    assert answer.headers["content-type"] == "application/problem+json"
    problem: dict[str, Any] = answer.json()
    assert problem["status"] == answer.status_code
    assert problem["detail"]
    return problem


@pytest.mark.full
@pytest.mark.parametrize("number", [*HUGE, 0, -1])
def test_there_is_no_such_run(shared: TestClient, number: int) -> None:
    for method, path in [
        ("GET", f"/api/library/runs/{number}"),
        ("GET", f"/api/library/runs/{number}/drawn"),
        ("GET", f"/api/library/recordings/{number}/runs"),
        ("GET", f"/api/library/thumbnail/{number}.jpg"),
        ("GET", f"/api/library/compared?runs={number}"),
        ("POST", f"/api/library/runs/{number}/open"),
        ("POST", f"/api/library/runs/{number}/pin"),
        ("GET", f"/api/step/{number - 2}"),
    ]:
        refused(shared.request(method, path))
    for path, body in [
        ("/api/commands", {"name": "use_again", "run": number}),
        ("/api/commands", {"name": "delete_runs", "runs": [number]}),
        ("/api/exports", {"run": number, "format": "csv"}),
        ("/api/view", {"camera": number - 2}),
        ("/api/commands", {"name": "remove_entrance", "index": number - 2}),
        ("/api/commands", {"name": "remove_template", "index": number - 2}),
    ]:
        refused(shared.post(path, json=body))


@pytest.mark.parametrize("name", NAMES)
def test_names_that_no_file_can_have(shared: TestClient, name: str) -> None:
    for path, field in [
        ("/api/sequence", "name"),
        ("/api/import/path", "path"),
    ]:
        refused(shared.post(path, json={field: name}))
    refused(command(shared, "apply_preset", preset=name))
    if name in IMPOSSIBLE:
        refused(command(shared, "copy_taught", folder=name))


def test_a_preset_has_a_name_that_can_be_seen(shared: TestClient) -> None:
    for name in ("a\0b", "\x1b[31mred", "\u202edesrever", " ", "x" * 61):
        refused(command(shared, "save_preset", preset=name))


@pytest.mark.full
@pytest.mark.parametrize("value", [10**400, -(10**400), "9" * 5000, [], {}, None, "\0", [[1]]])
def test_no_parameter_takes_what_it_does_not_take(shared: TestClient, value: Any) -> None:
    for key in (*PARAMETERS, *METHODS):
        answer = command(shared, "set_parameters", changes={key: value})
        assert refused(answer)["field"] == key


@pytest.mark.parametrize(
    "body",
    [
        b"\xff\xfe",
        b"[" * 100_000,
        b'{"step":' + b"9" * 5000 + b"}",
        b'{"step":NaN}',
        b'{"step":1e999}',
        b'{"\\ud800":1}',
        b'{"step":1,"changes":{},"origin":"\\ud800"}',
        b"",
        b"null",
        b"\x00",
    ],
)
def test_bodies_that_are_none(shared: TestClient, body: bytes) -> None:
    for path in ("/api/seek", "/api/commands"):
        headers = {"content-type": "application/json"}
        refused(shared.post(path, content=body, headers=headers))


def test_words_that_are_no_text_come_back_as_text(shared: TestClient) -> None:
    for method, path, body in [
        ("POST", "/api/commands", b'{"name":"set_parameters","changes":{"\\ud800":1}}'),
        ("PATCH", "/api/layers", b'{"changes":{"\\ud800":true}}'),
        (
            "POST",
            "/api/commands",
            b'{"name":"set_parameters","changes":{"fusion.clutter_rate":"\\ud800"}}',
        ),
    ]:
        headers = {"content-type": "application/json"}
        refused(shared.request(method, path, content=body, headers=headers))
    refused(shared.get("/api/%ff%fe"))
    refused(shared.get("/static/%00"))
    refused(shared.get("/static/" + "x" * 300))


def test_a_full_disk_is_said_and_changes_nothing(
    client: TestClient, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device", str(tmp_path / "presets.json"))

    own = client.app.state.presets  # type: ignore[attr-defined]
    monkeypatch.setattr(own, "_path", tmp_path / "presets.json")
    monkeypatch.setattr("app.state.presets.write_json", full)
    answer = command(client, "save_preset", preset="mine")
    assert answer.status_code == 507
    assert answer.json()["code"] == "disk_full"
    assert "No space left on device" in answer.json()["detail"]
    listed = client.get("/api/state").json()
    assert "mine" not in json.dumps(listed["presets"])


def test_a_body_that_does_not_come_is_not_waited_for(
    client: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    import anyio
    from starlette.types import Message

    monkeypatch.setattr(security, "SECONDS_TO_SEND", 0.05)
    told: list[Message] = []

    async def ask() -> None:
        parts = [{"type": "http.request", "body": b'{"st', "more_body": True}]

        async def receive() -> Message:
            if parts:
                return parts.pop()
            await anyio.sleep(30)
            raise AssertionError

        async def send(message: Message) -> None:
            told.append(message)

        scope = {
            "type": "http", "method": "POST", "path": "/api/seek", "raw_path": b"/api/seek",
            "query_string": b"", "root_path": "", "scheme": "http", "http_version": "1.1",
            "headers": [(b"host", b"localhost"), (b"content-type", b"application/json")],
            "server": ("127.0.0.1", 8000), "client": ("127.0.0.1", 1), "asgi": {"version": "3.0"},
        }  # fmt: skip
        await client.app(scope, receive, send)

    assert client.portal is not None
    client.portal.call(ask)
    assert told[0]["status"] == 408
