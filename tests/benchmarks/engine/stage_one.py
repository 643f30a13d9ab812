"""A slider of stage 1, which looks at every picture anew: its first step, and how soon it stops."""

from __future__ import annotations

import json
import random
import statistics
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx2
from websockets.sync.client import connect

from app.state.jobs import Jobs
from app.state.workbench import Workbench
from tests.app.conftest import command
from tests.benchmarks.engine.pipeline import DATA
from tests.benchmarks.measure import Measurement
from tests.browser.serving import Server
from tests.synthetic import write_sequence
from tracker.runs import pipeline
from tracker.runs.run import Run

P_D = "colour_phd.detection_probability"


def run(short: bool) -> Iterator[Measurement]:
    """On real video where it is at hand, else on a small painted recording."""
    with tempfile.TemporaryDirectory() as name:
        video = DATA / "av163-seq30-2p-1101"
        folder = video if video.is_dir() else Path(name) / "walkers"
        if folder != video:
            write_sequence(folder, frames=250)
        server = Server(folder, Path(name) / "cache")
        try:
            server.wait(lambda state: state["run"]["done"] > 0)
            yield from _first_steps(server, 4 if short else 20)
        finally:
            server.stop()
        yield from _stops(folder, 6 if short else 30)


def _first_steps(server: Server, movements: int) -> Iterator[Measurement]:
    """From a movement until the first step of the run that it asks for is told to the page."""
    address = server.address.replace("http", "ws") + "api/stream"
    times: list[float] = []
    with (
        connect(address, max_size=None) as socket,
        httpx2.Client(base_url=server.address) as client,
    ):
        socket.send(json.dumps({"type": "seek", "step": 0, "origin": "benchmark"}))
        rng = random.Random(1)
        for movement in range(movements):
            begin = time.perf_counter()
            changes = {P_D: round(0.6 + 0.01 * movement, 4)}
            answer = command(client, "set_parameters", changes=changes).json()
            key = answer["run"]["key"]
            while True:
                message: dict[str, Any] = json.loads(socket.recv(timeout=60.0))
                told = message["type"] == "step" and message["computed"] and message["run"] == key
                if told and message["step"] == 0:
                    break
            times.append(1000.0 * (time.perf_counter() - begin))
            time.sleep(rng.uniform(0.05, 0.3))
    name = f"slider of stage 1, {server.get('/api/state').json()['sequence']['name']}: first step"
    yield Measurement(f"{name}, median", statistics.median(times), "ms")
    yield Measurement(f"{name}, 95 %", statistics.quantiles(times, n=20)[-1], "ms", "≤ 1000 ms")


def _stops(folder: Path, runs: int) -> Iterator[Measurement]:
    """From a change, or a person's wish, until the run that was under way has ended."""
    rng = random.Random(2)
    ended: list[float] = []
    began: list[float] = []
    compute = pipeline.compute

    def stamped(*arguments: Any, **named: Any) -> Run:
        began.append(time.perf_counter())
        try:
            return compute(*arguments, **named)
        finally:
            ended.append(time.perf_counter())

    superseded: list[float] = []
    cancelled: list[float] = []
    pipeline.compute = stamped
    try:
        for number in range(runs):
            bench = Workbench()
            jobs = Jobs(bench)  # nothing is known of the recording: its background neither
            try:
                jobs.open(str(folder)).result(60.0)
                _wait_for(began, 1)
                # at any moment of the beginning, where backgrounds are learnt, and soon after
                time.sleep(rng.uniform(0.0, 1.0))
                asked = time.perf_counter()
                if number % 2:
                    bench.set_parameters({P_D: 0.7}, "benchmark")
                else:
                    jobs.cancel()
                _wait_for(ended, 1)
                if ended[0] > asked:  # else it was done already
                    taken = superseded if number % 2 else cancelled
                    taken.append(1000.0 * (ended[0] - asked))
            finally:
                jobs.close()
                began.clear()
                ended.clear()
    finally:
        pipeline.compute = compute
    for what, times in (("superseded", superseded), ("cancelled", cancelled)):
        name = f"a run {what} within its first second ends after"
        yield Measurement(f"{name}, median", statistics.median(times), "ms")
        yield Measurement(f"{name}, at most", max(times), "ms", "≤ 100 ms")


def _wait_for(stamps: list[float], count: int) -> None:
    deadline = time.monotonic() + 60.0
    while len(stamps) < count:
        if time.monotonic() > deadline:
            raise TimeoutError("no run began or ended within a minute")
        time.sleep(0.0005)
