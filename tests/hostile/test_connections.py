"""Garbage over the sockets, connections that ask nothing, readers that do not read: none of them
keeps the page from being answered within a second."""

from __future__ import annotations

import asyncio
import gc
import http.client
import os
import random
import socket
import threading
import time
import warnings
from collections.abc import Callable, Coroutine, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

import httpx
import pytest
import viser
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed
from websockets.typing import Subprotocol

from app.web import server
from app.web.access import connections
from app.web.server import listening
from tests.app.conftest import wait_until

VISER = Subprotocol(f"viser-v{viser.__version__}")
SOON = 1.5
"""Seconds: what there is patience for here."""


class Running:
    """A server in a thread of its own, on a free port."""

    def __init__(self, settings: server.Settings) -> None:
        self._listener = server.bind("127.0.0.1", 0)
        self.port: int = self._listener.getsockname()[1]
        self.address = f"http://127.0.0.1:{self.port}"
        self.ready = threading.Event()
        self._thread = threading.Thread(target=self._serve, args=(settings,), daemon=True)
        self._thread.start()
        assert self.ready.wait(60)
        self.in_peace = max(self._seconds("/") for _ in range(5))

    def _serve(self, settings: server.Settings) -> None:
        self.app = server.create_app(settings)
        server.serve(self.app, self._listener, self.ready.set)

    def answers_soon(self) -> None:
        """Page and state, to somebody who has no connection yet: within a second.

        On a machine that is busy with other things, within what it took in peace beside that.
        """
        for path in ("/", "/api/state"):
            assert self._seconds(path) < 1.0 + 3.0 * self.in_peace, path

    def _seconds(self, path: str) -> float:
        begin = time.monotonic()
        with closing(http.client.HTTPConnection("127.0.0.1", self.port, timeout=30.0)) as asked:
            asked.request("GET", path)
            answer = asked.getresponse()
            answer.read()
        assert answer.status == 200
        return time.monotonic() - begin

    def connection(self, said: bytes = b"", *, small: bool = False) -> socket.socket:
        there = socket.socket()
        if small:  # whoever does not read has little room for what comes
            there.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        there.settimeout(20.0)
        there.connect(("127.0.0.1", self.port))
        there.sendall(said)
        return there


@pytest.fixture(scope="module")
def running(data: Path) -> Iterator[Running]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(connections, "SECONDS_TO_ASK", SOON)
        patch.setattr(connections, "SECONDS_TO_READ", SOON)
        patch.setattr(listening, "_Server", Stoppable)
        running = Running(server.Settings(sequence="crossing", data=data))
        wait_until(lambda: httpx.get(f"{running.address}/viser/").status_code == 200)
        wait_until(lambda: httpx.get(f"{running.address}/api/state").json()["sequence"] is not None)
        yield running
        assert Stoppable.newest is not None
        Stoppable.newest.should_exit = True
        running._thread.join(20)
        assert not running._thread.is_alive()
        # a connection that was only being made as its loop ended is closed by who collects it
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ResourceWarning)
            gc.collect()


class Stoppable(listening._Server):
    """One that another thread can end."""

    newest: Stoppable | None = None

    def __init__(self, config: Any, on_ready: Callable[[], None]) -> None:
        super().__init__(config, on_ready)
        Stoppable.newest = self


def talked(talk: Callable[[], Coroutine[None, None, None]]) -> None:
    """Talk in a thread of its own: in this one Playwright's loop may run."""

    async def bounded() -> None:
        async with asyncio.timeout(60):
            await talk()

    with ThreadPoolExecutor(1) as pool:
        pool.submit(lambda: asyncio.run(bounded())).result()


def garbage(chance: random.Random) -> bytes | str:
    """A frame that nobody means: bytes, words, and what nearly is a message."""
    size = int(2 ** chance.uniform(0, 14))
    match chance.randrange(5):
        case 0:
            return chance.randbytes(size)
        case 1:
            return "".join(chr(chance.randrange(1, 0xD800)) for _ in range(min(size, 500)))
        case 2:
            kind = chance.choice(["seek", "select", "motion", "ping", "state", ""])
            value = chance.choice(["NaN", "1e999", "-1", "9" * 400, '"x"', "null", "[]", "true"])
            return f'{{"type":"{kind}","step":{value},"id":{value},"flies":{value}}}'
        case 3:
            return "[" * size
        case _:  # a map of msgpack that names one of viser's messages, and breaks off
            name = chance.choice([b"GuiUpdateMessage", b"ViewerCameraMessage", b"Message"])
            return b"\x82\xa4type" + bytes([0xA0 + len(name)]) + name + chance.randbytes(20)


@pytest.mark.full
@pytest.mark.parametrize("path", ["/api/stream", "/viser"])
def test_two_thousand_frames_of_garbage(running: Running, path: str) -> None:
    chance, frames = random.Random(7), 0

    async def drain(ws: ClientConnection) -> None:
        with suppress(ConnectionClosed):
            async for _ in ws:
                pass

    async def talk() -> None:
        nonlocal frames
        while frames < 1000:
            async with connect(
                f"ws://127.0.0.1:{running.port}{path}", subprotocols=[VISER], max_size=None
            ) as ws:
                reading = asyncio.create_task(drain(ws))
                with suppress(ConnectionClosed):
                    for _ in range(100):
                        frames += 1
                        await ws.send(garbage(chance))
                await ws.close()  # while it still reads
                await reading

    talked(talk)
    assert frames >= 1000
    running.answers_soon()
    state = httpx.get(f"{running.address}/api/state").json()
    assert state["sequence"]["name"] == "crossing"
    with suppress(OSError):
        assert len(os.listdir("/proc/self/fd")) < 400


@pytest.mark.full
@pytest.mark.parametrize(
    "said",
    [
        b"",
        b"G",
        b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Slow: ",
        b"GET /static/icon.svg HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\nGET /",
    ],
)
def test_two_hundred_connections_that_ask_nothing_are_dropped(
    running: Running, said: bytes
) -> None:
    many = [running.connection(said) for _ in range(200)]
    running.answers_soon()
    begin = time.monotonic()
    for there in many:
        with suppress(ConnectionResetError):
            while there.recv(65536):
                pass
        there.close()
    assert time.monotonic() - begin < SOON + 5.0
    running.answers_soon()


@pytest.mark.full
def test_more_connections_than_are_meant_are_turned_away(
    running: Running, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connections, "MOST", 20)
    many = []
    for _ in range(60):
        with suppress(OSError):
            many.append(running.connection())
    time.sleep(SOON / 2)
    assert Stoppable.newest is not None
    assert len(Stoppable.newest.server_state.connections) <= 20
    for there in many:
        there.close()
    wait_until(lambda: len(Stoppable.newest.server_state.connections) < 10, 10.0)  # type: ignore[union-attr]
    running.answers_soon()


UPGRADE = (
    b"GET /viser HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n"
    b"Sec-WebSocket-Protocol: " + VISER.encode() + b"\r\n\r\n"
)


@pytest.mark.full
def test_readers_that_do_not_read_are_dropped(running: Running) -> None:
    # more than the system keeps for whoever does not read
    page = b"GET /viser/ HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n" * 20
    slow = [running.connection(page, small=True) for _ in range(50)]
    assert Stoppable.newest is not None
    open_now = Stoppable.newest.server_state.connections
    running.answers_soon()
    wait_until(lambda: len(open_now) < 10, 20.0)
    for there in slow:
        there.close()


@pytest.mark.full
def test_a_page_that_is_slow_to_read_the_stream_is_dropped_and_holds_nobody_up(
    running: Running,
) -> None:
    stream = UPGRADE.replace(b"/viser ", b"/api/stream ", 1)
    slow = [running.connection(said, small=True) for said in [stream] * 3]
    time.sleep(0.2)
    assert Stoppable.newest is not None
    open_now = Stoppable.newest.server_state.connections
    sockets = [one for one in open_now if isinstance(one, connections.Sockets)]
    assert len(sockets) == 3
    deadline = time.monotonic() + 30.0
    step = 0
    while any(one in open_now for one in sockets):
        assert time.monotonic() < deadline, "they are still there"
        step = (step + 7) % 120
        httpx.post(f"{running.address}/api/seek", json={"step": step})
        httpx.patch(f"{running.address}/api/layers", json={"changes": {"trails": step % 2 == 0}})
    running.answers_soon()
    for there in slow:
        there.close()


@pytest.mark.full
def test_an_ordinary_slow_conversation_goes_on(running: Running) -> None:
    with closing(http.client.HTTPConnection("127.0.0.1", running.port, timeout=30.0)) as there:
        for _ in range(4):  # longer in all than one may take to ask
            there.request("GET", "/static/icon.svg")
            answer = there.getresponse()
            assert answer.status == 200
            answer.read()
            same = there.sock
            time.sleep(SOON * 0.6)
            assert there.sock is same
