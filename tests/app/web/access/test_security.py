"""Foreign hosts and origins are refused before anything else sees them."""

from __future__ import annotations

import pytest
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse
from starlette.routing import Route
from starlette.testclient import TestClient
from starlette.websockets import WebSocketDisconnect

from app.web.access.security import LARGEST_BODY, Guard, allowed_hosts, is_loopback
from tests.app.conftest import ADDRESS, connect

OWN = {"origin": ADDRESS}
FOREIGN = [
    "http://evil.example",
    "https://127.0.0.1.evil.example:8000",
    "http://127.0.0.1:8001",
    "http://localhost:8000",
    "null",
    "file://",
    "127.0.0.1:8000",
    "",
]


@pytest.mark.full
@pytest.mark.parametrize(
    "host",
    [
        "evil.example",
        "evil.example:8000",
        "127.0.0.1.evil.example",
        "localhost.evil.example:8000",
        "127.0.0.1@evil.example",
        "192.168.1.5:8000",
        "[",
        "",
    ],
)
def test_a_foreign_host_gets_nothing(shared: TestClient, host: str) -> None:
    for path in ("/", "/api/state", "/viser/", "/openapi.json", "/static/js/main.js"):
        answer = shared.get(path, headers={"host": host})
        assert answer.status_code == 421
        assert answer.json()["code"] == "foreign_host"
    with (
        pytest.raises(WebSocketDisconnect),
        connect(shared, host=host),
    ):
        pass


@pytest.mark.parametrize("host", ["127.0.0.1:8000", "localhost", "LOCALHOST:9", "[::1]:8000"])
def test_our_own_names_are_answered(shared: TestClient, host: str) -> None:
    assert shared.get("/api/state", headers={"host": host}).status_code == 200


@pytest.mark.parametrize("origin", FOREIGN)
def test_a_foreign_page_may_not_write(shared: TestClient, origin: str) -> None:
    before = shared.get("/api/state").json()["version"]
    for method, path, body in [
        ("POST", "/api/select", {"id": 1}),
        ("POST", "/api/commands", {"name": "set_parameters", "changes": {}}),
        ("POST", "/api/sequence", {"name": "numbers"}),
        ("POST", "/api/run/cancel", None),
        ("PUT", "/anything", None),
        ("DELETE", "/api/state", None),
    ]:
        answer = shared.request(method, path, json=body, headers={"origin": origin})
        assert answer.status_code == 403
        assert answer.json()["code"] == "foreign_origin"
    assert shared.get("/api/state").json()["version"] == before


@pytest.mark.parametrize("origin", FOREIGN)
@pytest.mark.parametrize("path", ["/api/stream", "/viser", "/viser/"])
def test_a_foreign_page_gets_no_socket(shared: TestClient, path: str, origin: str) -> None:
    with (
        pytest.raises(WebSocketDisconnect) as refusal,
        connect(shared, path, origin=origin),
    ):
        pass
    assert refusal.value.code == 1008


def test_our_own_page_may_write_and_connect(shared: TestClient) -> None:
    assert shared.post("/api/select", json={"id": 1}, headers=OWN).status_code == 200
    with connect(shared, **OWN) as socket:
        assert socket.receive_json()["type"] in ("state", "playhead")


def test_who_is_no_browser_may_write(shared: TestClient) -> None:
    assert shared.post("/api/select", json={"id": 1}).status_code == 200


def test_bodies_are_small(shared: TestClient) -> None:
    body = b'{"name":"set_parameters","changes":{},"origin":"' + b"x" * LARGEST_BODY + b'"}'
    answer = shared.post("/api/commands", content=body)
    assert answer.status_code == 413
    assert answer.json()["code"] == "too_large"

    def piecewise() -> object:
        for start in range(0, len(body), 65536):
            yield body[start : start + 65536]

    answer = shared.post("/api/commands", content=piecewise())  # type: ignore[arg-type]
    assert answer.status_code == 413
    assert answer.json()["code"] == "too_large"


def test_no_other_page_may_frame_ours(shared: TestClient) -> None:
    for path in ("/", "/api/state", "/docs"):
        answer = shared.get(path)
        assert answer.headers["x-frame-options"] == "SAMEORIGIN"
        assert answer.headers["x-content-type-options"] == "nosniff"


@pytest.mark.parametrize(
    ("host", "loopback"),
    [
        ("127.0.0.1", True),
        ("127.8.8.8", True),
        ("::1", True),
        ("localhost", True),
        ("0.0.0.0", False),
        ("192.168.1.5", False),
        ("workstation", False),
    ],
)
def test_what_is_loopback(host: str, loopback: bool) -> None:
    assert is_loopback(host) == loopback


def test_a_server_for_others_answers_to_addresses_but_to_no_foreign_name() -> None:
    async def hello(_: Request) -> PlainTextResponse:
        return PlainTextResponse("hello")

    app = Guard(
        Starlette(routes=[Route("/", hello, methods=["GET", "POST"])]),
        hosts=allowed_hosts("0.0.0.0"),
        addresses_are_fine=True,
    )
    client = TestClient(app)
    for host, status in [
        ("192.168.1.5:8000", 200),
        ("[fe80::1]:8000", 200),
        ("localhost:8000", 200),
        ("evil.example", 421),
    ]:
        assert client.get("/", headers={"host": host}).status_code == status
    headers = {"host": "192.168.1.5:8000", "origin": "http://evil.example"}
    assert client.post("/", headers=headers).status_code == 403
