"""Garbage over the sockets, connections that ask nothing, readers that do not read: none of them
keeps the page from being answered, and none of them stays."""

from __future__ import annotations

import asyncio
import gc
import http.client
import os
import random
import select
import socket
import threading
import time
import warnings
from collections.abc import Callable, Coroutine, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, closing, suppress
from pathlib import Path
from typing import Any

import httpx
import pytest
import viser
from fastapi import FastAPI
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed
from websockets.typing import Subprotocol

from app.web import server
from app.web.dependencies import Settings
from tests.app.conftest import wait_until

VISER = Subprotocol(f"viser-v{viser.__version__}")
SOON = 1.5
"""Seconds: what there is patience for here."""
LATER = 30.0
"""Seconds until whoever waits for an answer gives up; a server that is held up would take for
ever, one on a busy machine some seconds."""


class Running:
    """A server in a thread of its own, on a free port."""

    def __init__(self, settings: Settings) -> None:
        self._listener = server.bind("127.0.0.1", 0)
        self.port: int = self._listener.getsockname()[1]
        self.address = f"http://127.0.0.1:{self.port}"
        self.ready = threading.Event()
        self._thread = threading.Thread(target=self._serve, args=(settings,), daemon=True)
        self._thread.start()
        assert self.ready.wait(60)

    def _serve(self, settings: Settings) -> None:
        self.app = server.create_app(settings)
        server.serve(self.app, self._listener, self.ready.set)

    def answers(self) -> None:
        """Page and state, to somebody who has no connection yet."""
        for path in ("/", "/api/state"):
            assert self.get(path).status_code == 200, path

    def get(self, path: str) -> httpx.Response:
        """An answer, to a connection of its own."""
        return httpx.get(f"{self.address}{path}", timeout=LATER)

    def asking(self) -> http.client.HTTPConnection:
        """A connection of somebody who asks as browsers do."""
        return http.client.HTTPConnection("127.0.0.1", self.port, timeout=LATER)

    def connection(self, said: bytes = b"", *, small: bool = False) -> socket.socket:
        there = socket.socket()
        if small:  # whoever does not read has little room for what comes
            there.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        there.settimeout(LATER)
        there.connect(("127.0.0.1", self.port))
        there.sendall(said)
        return there


@pytest.fixture(scope="module")
def running(data: Path) -> Iterator[Running]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(server, "SECONDS_TO_ASK", SOON)
        patch.setattr(server, "SECONDS_TO_READ", SOON)
        patch.setattr(server, "_Server", Stoppable)
        running = Running(Settings(sequence="crossing", data=data))
        wait_until(lambda: running.get("/viser/").status_code == 200)
        wait_until(lambda: running.get("/api/state").json()["sequence"] is not None)
        yield running
        assert Stoppable.newest is not None
        Stoppable.newest.should_exit = True
        running._thread.join(LATER)
        assert not running._thread.is_alive()
        # a connection that was only being made as its loop ended is closed by who collects it
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ResourceWarning)
            gc.collect()


class Stoppable(server._Server):
    """One that another thread can end."""

    newest: Stoppable | None = None

    def __init__(self, config: Any, on_ready: Callable[[], None]) -> None:
        super().__init__(config, on_ready)
        Stoppable.newest = self


def talked(talk: Callable[[], Coroutine[None, None, None]]) -> None:
    """Talk in a thread of its own: in this one Playwright's loop may run."""

    async def bounded() -> None:
        async with asyncio.timeout(10.0 * LATER):
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
    running.answers()
    state = running.get("/api/state").json()
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
    with ExitStack() as ended:
        many = [ended.enter_context(running.connection(said)) for _ in range(200)]
        running.answers()
        for there in many:  # each waits until it is dropped
            with suppress(ConnectionResetError):
                while there.recv(65536):
                    pass
    running.answers()


@pytest.mark.full
def test_more_connections_than_are_meant_are_turned_away(
    running: Running, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(server, "MOST", 20)
    monkeypatch.setattr(server, "SECONDS_TO_ASK", 2.0 * LATER)  # it is not they who give up
    assert Stoppable.newest is not None
    open_now = Stoppable.newest.server_state.connections
    with ExitStack() as ended:
        many = [ended.enter_context(running.connection()) for _ in range(60)]
        wait_until(lambda: len(select.select(many, [], [], 0.0)[0]) >= 40, LATER)
        assert len(open_now) <= 20
    wait_until(lambda: len(open_now) < 10, LATER)
    running.answers()


def test_who_is_still_served_when_the_server_ends_is_cancelled_without_a_word(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    app, asked, ready = FastAPI(), threading.Event(), threading.Event()

    @app.get("/endless")
    async def endless() -> None:
        asked.set()
        await asyncio.sleep(3600.0)

    monkeypatch.setattr(server, "_Server", Stoppable)
    monkeypatch.setattr(Stoppable, "newest", None)  # that of the others is so again afterwards
    listener = server.bind("127.0.0.1", 0)
    thread = threading.Thread(target=server.serve, args=(app, listener, ready.set), daemon=True)
    thread.start()
    assert ready.wait(LATER)
    with closing(socket.create_connection(listener.getsockname()[:2], LATER)) as there:
        there.sendall(b"GET /endless HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        assert asked.wait(LATER)
        assert Stoppable.newest is not None
        Stoppable.newest.should_exit = True
        thread.join(LATER)
    assert not thread.is_alive()
    assert capfd.readouterr().err == ""


UPGRADE = (
    b"GET /viser HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n"
    b"Sec-WebSocket-Protocol: " + VISER.encode() + b"\r\n\r\n"
)


@pytest.mark.full
def test_readers_that_do_not_read_are_dropped(running: Running) -> None:
    # more than the system keeps for whoever does not read
    page = b"GET /viser/ HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n" * 20
    assert Stoppable.newest is not None
    open_now = Stoppable.newest.server_state.connections
    with ExitStack() as ended:
        for _ in range(50):
            ended.enter_context(running.connection(page, small=True))
        running.answers()
        wait_until(lambda: len(open_now) < 10, LATER)


@pytest.mark.full
def test_a_page_that_is_slow_to_read_the_stream_is_dropped_and_holds_nobody_up(
    running: Running,
) -> None:
    stream = UPGRADE.replace(b"/viser ", b"/api/stream ", 1)
    assert Stoppable.newest is not None
    open_now = Stoppable.newest.server_state.connections

    def readers() -> list[Any]:
        return [one for one in open_now if isinstance(one, server.Sockets)]

    with ExitStack() as ended:
        for said in [stream] * 3:
            ended.enter_context(running.connection(said, small=True))
        wait_until(lambda: len(readers()) == 3, LATER)
        step, deadline = 0, time.monotonic() + 2.0 * LATER
        while readers():
            assert time.monotonic() < deadline, "they are still there"
            step = (step + 7) % 120
            httpx.post(f"{running.address}/api/seek", json={"step": step}, timeout=LATER)
            changes = {"trails": step % 2 == 0}
            httpx.patch(f"{running.address}/api/layers", json={"changes": changes}, timeout=LATER)
        running.answers()


@pytest.mark.full
def test_an_ordinary_slow_conversation_goes_on(running: Running) -> None:
    with closing(running.asking()) as there:
        for _ in range(4):  # longer in all than one may take to ask
            there.request("GET", "/static/icon.svg")
            answer = there.getresponse()
            assert answer.status == 200
            answer.read()
            same = there.sock
            time.sleep(SOON * 0.6)
            assert there.sock is same
