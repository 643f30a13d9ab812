"""The real server in a process of its own: page, 3D view behind the same port, Ctrl-C."""

from __future__ import annotations

import asyncio
import os
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Coroutine, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import httpx
import pytest
import viser
from starlette.testclient import TestClient
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed
from websockets.typing import Origin, Subprotocol

from app.command import main as cli
from app.web.dependencies import Settings
from app.web.running import say_failure
from app.web.server import build_routes, create_app
from tests.app.conftest import wait_until
from tests.app.folders import write_crossing
from tracker.runs.pipeline import Cancelled

T = TypeVar("T")
VISER = Subprotocol(f"viser-v{viser.__version__}")


def said(talk: Callable[[], Coroutine[None, None, T]]) -> T:
    """What a talk gives, in a thread of its own: in this one Playwright's loop may run."""
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(lambda: asyncio.run(talk())).result()


@dataclass
class Server:
    process: subprocess.Popen[str]
    address: str
    token: str = ""

    @property
    def place(self) -> str:
        return self.address.removeprefix("http://")


def start(*arguments: str) -> Server:
    """Start it, without a token unless the arguments ask for one."""
    words = arguments if "--token" in arguments else (*arguments, "--no-token")
    process = subprocess.Popen(
        [sys.executable, "-m", "app", "serve", *words, "--port", "0", "--no-open"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    line = process.stdout.readline()
    match = re.fullmatch(
        r"multiview-phd: (http://127\.0\.0\.1:\d+)/(?:\?token=([\w-]{43}))? \(Ctrl-C ends it\)\n",
        line,
    )
    assert match, (line, process.stderr.read() if process.stderr and not line else "")
    assert (match[2] is not None) == ("--token" in arguments)
    return Server(process, match[1], match[2] or "")


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    server = start(str(write_crossing(tmp_path_factory.mktemp("serve") / "crossing")))
    yield server
    server.process.send_signal(signal.SIGINT)
    out, err = server.process.communicate(timeout=20)
    # on a new machine it says that it compiles, and when that is done
    others = [line for line in err.splitlines() if "kernels" not in line]
    assert (out, others) == ("", [])
    assert server.process.returncode == 0


@pytest.mark.full
def test_the_page_is_there_and_the_run_is_done_soon(server: Server) -> None:
    page = httpx.get(server.address)
    assert page.status_code == 200
    assert "multiview-phd" in page.text
    wait_until(lambda: httpx.get(f"{server.address}/api/state").json()["run"]["state"] == "done")


@pytest.mark.full
def test_visers_page_is_served_with_a_focus_that_stays(server: Server) -> None:
    answer = httpx.get(f"{server.address}/viser", follow_redirects=True)
    assert answer.url.path == "/viser/"
    told = r'<head><script nonce="[^"]+">Document\.prototype\.hasFocus=\(\)=>true</script>'
    assert re.search(told, answer.text)
    again = httpx.get(answer.url, headers={"if-none-match": answer.headers["etag"]})
    assert again.status_code == 304


@pytest.mark.full
def test_visers_socket_passes_through_with_its_subprotocol(server: Server) -> None:
    async def talk() -> tuple[str | None, int]:
        async with connect(
            f"ws://{server.place}/viser",
            subprotocols=[VISER],
            origin=Origin(server.address),
            max_size=None,
        ) as ws:
            async with asyncio.timeout(20):
                first = await ws.recv()
            assert isinstance(first, bytes)
            return ws.subprotocol, len(first)

    subprotocol, size = said(talk)
    assert subprotocol == VISER
    assert size > 0


@pytest.mark.full
def test_viser_says_itself_why_it_closes(server: Server) -> None:
    async def talk() -> None:
        async with connect(
            f"ws://{server.place}/viser", subprotocols=[Subprotocol("viser-v0.0.1")]
        ) as ws:
            async with asyncio.timeout(20):
                while True:
                    await ws.recv()

    with pytest.raises(ConnectionClosed) as closed:
        said(talk)
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code == 1002
    assert "Version mismatch" in closed.value.rcvd.reason


def test_no_token_is_for_this_machine_alone(
    crossing: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for host in ("0.0.0.0", "::", "192.168.1.5"):
        command = ["serve", str(crossing), "--no-open", "--no-token", "--host", host]
        assert cli.main(command) == 2
        assert f"--no-token: expected --host of this machine alone, got {host}" in (
            capsys.readouterr().err
        )
    monkeypatch.setenv("MULTIVIEW_PHD_TOKEN", "short")
    assert cli.main(["serve", str(crossing), "--no-open"]) == 1
    assert "$MULTIVIEW_PHD_TOKEN: expected 16 or more" in capsys.readouterr().err


def test_visers_public_tunnel_cannot_be_asked_for() -> None:
    from viser import _messages

    from app.web.access.gateway import start_viser

    running = start_viser()
    try:
        handlers = running._websock_server._incoming_handlers
        assert _messages.ShareUrlRequest not in handlers
    finally:
        running.stop()


@pytest.mark.full
def test_ctrl_c_ends_it_soon_also_with_a_page_open(tmp_path: Path) -> None:
    server = start(str(write_crossing(tmp_path / "crossing")))

    async def talk() -> None:
        async with (
            connect(f"ws://{server.place}/api/stream", max_size=None) as page,
            connect(f"ws://{server.place}/viser", subprotocols=[VISER], max_size=None) as room,
        ):
            await page.recv()
            await room.recv()
            server.process.send_signal(signal.SIGINT)
            await asyncio.to_thread(server.process.wait, 60)  # while both are connected

    said(talk)
    assert server.process.returncode == 0
    assert server.process.communicate() == ("", "")


def test_a_port_that_is_taken(crossing: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        assert cli.main(["serve", str(crossing), "--port", str(port), "--no-open"]) == 1
    err = capsys.readouterr().err
    match = re.fullmatch(
        rf"multiview-phd: port {port} is taken by another program; try --port (\d+)\n", err
    )
    assert match
    assert int(match[1]) > port


def test_what_cannot_be_served_is_said_before_a_page_is_open(
    tmp_path: Path, crossing: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["serve", str(tmp_path / "nowhere"), "--no-open"]) == 1
    assert "nowhere" in capsys.readouterr().err
    assert cli.main(["serve", "nonsense", "--no-open"]) == 1
    assert 'no sequence "nonsense"' in capsys.readouterr().err
    assert cli.main(["serve", "--data", str(tmp_path / "nowhere"), "--no-open"]) == 1
    assert "--data" in capsys.readouterr().err
    assert cli.main(["serve", str(crossing), "--host", "203.0.113.1", "--no-open"]) == 1
    err = capsys.readouterr().err
    assert "cannot listen on 203.0.113.1:8000" in err
    assert err.count("\n") == 1


def test_the_browser_opens_by_itself_only_where_there_is_a_screen(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from app.command.flags import Serve, parse

    if sys.platform.startswith(("win", "darwin")):
        pytest.skip("there always is a screen")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert os.environ.get("DISPLAY") is None
    for arguments, opens in ([], False), (["--open"], True), (["--no-open"], False):
        command = parse(["serve", *arguments])
        assert isinstance(command, Serve)
        assert command.open == opens
    monkeypatch.setenv("DISPLAY", ":0")
    command = parse(["serve"])
    assert isinstance(command, Serve)
    assert command.open
    assert command.sequence == "room44-3p"
    assert (command.host, command.port) == ("127.0.0.1", 8000)


def test_no_route_is_built_while_other_threads_may_warn(monkeypatch: pytest.MonkeyPatch) -> None:
    app = create_app(Settings(with_viser=False))
    build_routes(app)

    def silenced(*_: object, **__: object) -> None:
        raise AssertionError("a filter of warnings that other threads may take away")

    with TestClient(app, base_url="http://127.0.0.1:8000") as client:
        monkeypatch.setattr("warnings.catch_warnings", silenced)
        for path in ("/api/state", "/api/runs"):
            assert client.get(path).status_code == 200
        monkeypatch.undo()
        assert app.openapi_schema is None  # a start does not wait for it
        assert client.get("/openapi.json").status_code == 200


def test_an_opening_that_the_end_cut_short_is_no_failure(caplog: pytest.LogCaptureFixture) -> None:
    for error in (Cancelled("the end"), ValueError("no such folder")):
        future: Future[None] = Future()
        future.add_done_callback(say_failure("crossing"))
        future.set_exception(error)
    assert [r.getMessage() for r in caplog.records] == ["crossing cannot be opened: no such folder"]
