"""A workbench that crashes in the middle of a run ends that run and nothing else."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import httpx2
import pytest

from app.state.crashes import LAST
from tests.app.folders import write_crossing
from tests.browser.serving import Server

TOKEN = "the-token-of-these-calls"


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Server]:
    folder = write_crossing(tmp_path / "long", frames=1000)
    server = Server(folder, tmp_path / "cache", data=tmp_path, token=TOKEN)
    yield server
    if server.process.poll() is None:
        server.stop()


def change(server: Server, values: dict[str, float]) -> None:
    server.command("set_parameters", changes=values)


def post(server: Server, path: str) -> None:
    headers = {"Authorization": f"Bearer {TOKEN}"}
    httpx2.post(f"{server.address}api/{path}", headers=headers).raise_for_status()


def crash(server: Server, number: int) -> None:
    """End the process that serves, and wait for the next one."""
    ended = server.serving
    ended.send_signal(number)
    deadline = time.monotonic() + 10.0
    while ended.is_running() and time.monotonic() < deadline:
        time.sleep(0.01)
    assert not ended.is_running()


@pytest.mark.full
def test_a_crash_in_a_run_ends_that_run_and_nothing_else(server: Server) -> None:
    server.wait_for_run()
    change(server, {"fusion.clutter_rate": 2.5})
    good = server.wait_for_run()
    tracks = server.get("/api/export/tracks.csv").content
    assert tracks.count(b"\n") > 1000
    state = good
    for rate in (4.5, 5.5, 6.5):
        change(server, {"fusion.clutter_rate": rate})
        before = state["run"]["key"]
        server.wait(lambda state, before=before: state["run"]["key"] != before)
        state = server.wait(lambda state: state["run"]["done"] > 0)
        if state["run"]["done"] < 500:  # where nobody let this process wait meanwhile
            break
    assert state["run"]["state"] == "computing"  # in the middle of it
    crash(server, signal.SIGSEGV)
    after = server.wait(
        lambda state: state["sequence"] is not None and state["run"]["state"] == "failed"
    )
    assert after["session"] != state["session"]
    assert after["sequence"]["key"] == state["sequence"]["key"]
    assert after["parameters"]["fusion.clutter_rate"] == rate
    assert "crashed while this run was computed" in after["run"]["error"]
    assert server.get("/api/export/tracks.csv").content == tracks  # the last that went well
    report = (server.cache / "settings" / "starts" / LAST).read_text(encoding="utf-8")
    assert f"ended by signal {int(signal.SIGSEGV)}" in report
    assert "fusion.clutter_rate" in report
    assert "Fatal Python error: Segmentation fault" in report
    # a start of somebody begins with what went well; the run stays left out until it is asked for
    server.stop()
    server.start()
    begun = server.wait(lambda state: state["run"]["state"] in ("done", "failed"))
    assert (begun["run"]["state"], begun["run"]["key"]) == ("done", good["run"]["key"])
    assert begun["parameters"]["fusion.clutter_rate"] == 2.5
    change(server, {"fusion.clutter_rate": rate})
    left_out = server.wait(lambda state: state["run"]["state"] == "failed")
    assert "crashed while this run was computed" in left_out["run"]["error"]
    post(server, "run")
    again = server.wait_for_run()
    assert again["parameters"]["fusion.clutter_rate"] == rate
    assert again["run"]["key"] == after["run"]["key"] != good["run"]["key"]
    assert server.stop() < 10.0
    assert server.process.returncode == 0


@pytest.mark.full
def test_whoever_ends_it_ends_both(server: Server) -> None:
    serving = server.serving
    server.process.send_signal(signal.SIGTERM)
    server.process.communicate(timeout=60.0)
    assert not serving.is_running()
    server.start()
    serving = server.serving
    server.process.kill()
    server.process.communicate(timeout=60.0)
    serving.wait(timeout=30.0)


CRASHES = """
import os, signal, sys
from app.command import supervision
from pathlib import Path

def serve():
    with Path(sys.argv[1]).open("a") as file:
        file.write(f"{supervision.life.port} {supervision.life.ended} {supervision.life.token}\\n")
    if sys.argv[2] != "at once":
        supervision.life.listens(4711)
    os.kill(os.getpid(), getattr(signal, sys.argv[3]))

# whatever the tests are run by, as nohup, which has it ignored
signal.signal(getattr(signal, sys.argv[3]), signal.SIG_DFL)
sys.exit(supervision.supervise(serve))
"""


def starts(path: Path, when: str, name: str) -> tuple[int, list[list[str]], str]:
    path.write_text("")
    line = [sys.executable, "-c", CRASHES, str(path), when, name]
    done = subprocess.run(line, capture_output=True, text=True, timeout=60.0, check=False)
    return done.returncode, [row.split() for row in path.read_text().splitlines()], done.stderr


def test_what_crashes_again_and_again_is_left(tmp_path: Path) -> None:
    status, rows, told = starts(tmp_path / "starts", "later", "SIGSEGV")
    assert status == 128 + signal.SIGSEGV
    assert len(rows) == 5
    assert rows[0][:2] == ["None", "None"]
    assert {row[0] for row in rows[1:]} == {"4711"}
    assert len({row[-1] for row in rows}) == 1
    assert "SIGSEGV (segmentation fault); it is not started again" in told


def test_a_crash_before_anybody_could_come_is_not_repeated(tmp_path: Path) -> None:
    status, rows, _ = starts(tmp_path / "starts", "at once", "SIGABRT")
    assert (status, len(rows)) == (128 + signal.SIGABRT, 1)


@pytest.mark.full
@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP"])
def test_an_end_on_purpose_is_one(tmp_path: Path, name: str) -> None:
    status, rows, told = starts(tmp_path / "starts", "later", name)
    assert (status, len(rows), told) == (-getattr(signal, name), 1, "")


def test_a_function_that_ends_gives_its_status() -> None:
    line = "import sys; from app.command import supervision as s; sys.exit(s.supervise(lambda: 7))"
    assert subprocess.run([sys.executable, "-c", line], check=False).returncode == 7
