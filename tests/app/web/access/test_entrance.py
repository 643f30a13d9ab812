"""viser answers to the gateway alone: nobody else gets as far as its first message."""

from __future__ import annotations

import asyncio
import os
import socket
import sys
from collections.abc import Awaitable, Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TypeVar

import msgspec
import pytest
import viser
import websockets.asyncio.server
from viser import _messages
from websockets.asyncio.client import connect, unix_connect
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.typing import Subprotocol

from app.web.access.gateway import LARGEST_MESSAGE, SECRET_HEADER, Entrance, start_viser

T = TypeVar("T")
VISER = Subprotocol(f"viser-v{viser.__version__}")


def done(talk: Callable[[], Awaitable[T]]) -> T:
    """What a talk gives, in a thread of its own: in this one Playwright's loop may run."""

    async def bounded() -> T:
        async with asyncio.timeout(20):
            return await talk()

    with ThreadPoolExecutor(1) as pool:
        return pool.submit(lambda: asyncio.run(bounded())).result()


Running = tuple[viser.ViserServer, Entrance]


@pytest.fixture(scope="module", params=["port", "abstract"])
def running(request: pytest.FixtureRequest) -> Iterator[Running]:
    if request.param == "abstract" and sys.platform != "linux":
        pytest.skip("only Linux has abstract addresses")
    entrance = Entrance(port=request.param == "port")
    server = start_viser(entrance)
    yield server, entrance
    server.stop()


def raw(entrance: Entrance) -> socket.socket:
    if entrance.path is None:
        return socket.create_connection(("127.0.0.1", entrance.port), 10.0)
    there = socket.socket(socket.AF_UNIX)
    there.settimeout(10.0)
    there.connect(entrance.path)
    return there


def test_the_gateway_is_let_in(running: Running) -> None:
    async def talk() -> tuple[str | None, int]:
        async with await running[1].connect([VISER]) as ws:
            return ws.subprotocol, len(await ws.recv())

    subprotocol, size = done(talk)
    assert subprotocol == VISER
    assert size > 0


@pytest.mark.parametrize(
    "headers",
    [
        {},
        {SECRET_HEADER: ""},
        {SECRET_HEADER: "x" * 43},
        {SECRET_HEADER: "é"},
        {"Origin": "http://127.0.0.1:8000"},
        {"Origin": "null", "Cookie": f"{SECRET_HEADER}=x"},
    ],
)
def test_whoever_does_not_know_the_secret_is_turned_away(
    running: Running, headers: dict[str, str]
) -> None:
    server, entrance = running
    heard: list[object] = []
    server._websock_server.on_client_connect(heard.append)  # type: ignore[arg-type]

    async def talk() -> None:
        options = {"subprotocols": [VISER], "additional_headers": headers}
        if entrance.path is None:
            await connect(f"ws://127.0.0.1:{entrance.port}", **options)
        else:
            await unix_connect(entrance.path, "ws://127.0.0.1", **options)

    with pytest.raises(InvalidStatus) as refused:
        done(talk)
    assert refused.value.response.status_code == 403
    assert heard == []


def test_two_secrets_are_none(running: Running) -> None:
    lines = [f"{SECRET_HEADER}: {running[1]._secret}"] * 2
    with raw(running[1]) as there:
        there.sendall("\r\n".join(["GET / HTTP/1.1", "Host: x", *lines, "", ""]).encode())
        assert there.recv(4096).startswith(b"HTTP/1.1 403")


@pytest.mark.parametrize(
    "said",
    [
        b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n",
        b"GET /index.html HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\n\r\n",
        b"GET /%2e%2e/%2e%2e/etc/passwd HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n",
    ],
)
def test_nothing_is_served_on_it(running: Running, said: bytes) -> None:
    with raw(running[1]) as there:
        there.sendall(said)
        answer = b""
        while piece := there.recv(65536):
            answer += piece
    assert answer.startswith(b"HTTP/1.1 403")
    assert b"<html" not in answer


@pytest.mark.parametrize("said", [b"\x00" * 4096, b"POST / HTTP/1.1\r\n\r\n", b"\x16\x03\x01\x02"])
def test_what_is_no_request_ends_the_connection(running: Running, said: bytes) -> None:
    with raw(running[1]) as there:
        there.sendall(said)
        there.shutdown(socket.SHUT_WR)
        assert b" 101 " not in there.recv(65536)


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_no_port_is_open_for_it_where_the_system_can_do_without() -> None:
    def listening() -> set[str]:
        tables = [
            Path(f"/proc/self/net/{name}").read_text().splitlines()[1:] for name in ("tcp", "tcp6")
        ]
        rows = [line.split() for table in tables for line in table]
        inodes = {row[9] for row in rows if row[3] == "0A"}
        own = {os.readlink(path) for path in Path("/proc/self/fd").iterdir() if path.is_symlink()}
        return {inode for inode in inodes if f"socket:[{inode}]" in own}

    before = listening()
    server = start_viser()
    try:
        assert listening() == before
    finally:
        server.stop()


def test_a_page_may_not_fill_the_memory(running: Running) -> None:
    server, entrance = running
    slider = server.gui.add_slider("x", 0.0, 1.0, 0.1, 0.5)
    wishes = [
        _messages.FileTransferStartUpload(slider._impl.uuid, "y", "f", "text/plain", 2, 10),
        _messages.GuiUpdateMessage(slider._impl.uuid, {"value": 0.25}),
    ]

    async def talk() -> None:
        ws = await entrance.connect([VISER])
        await ws.recv()
        for wish in wishes:
            await ws.send(msgspec.msgpack.encode(wish.as_serializable_dict([])))
        while slider.value != 0.25:  # messages are heard in their order
            await asyncio.sleep(0.01)
        assert server.gui._current_file_upload_states == {}
        # one message of more than that ends it
        await ws.send(b"x" * (LARGEST_MESSAGE + 1))
        while True:
            await ws.recv()

    with pytest.raises(ConnectionClosed):
        done(talk)


def test_viser_that_listens_by_itself_is_not_started(monkeypatch: pytest.MonkeyPatch) -> None:
    class Other:
        stopped = False

        def __init__(self, **_: object) -> None: ...

        def stop(self) -> None:
            Other.stopped = True

    serve = websockets.asyncio.server.serve
    monkeypatch.setattr(viser, "ViserServer", Other)
    with pytest.raises(RuntimeError, match="viser listens by other means"):
        start_viser()
    assert Other.stopped
    assert websockets.asyncio.server.serve is serve
