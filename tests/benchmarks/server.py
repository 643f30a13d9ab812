"""The real server: how long until the page can be used, and how long a scrub takes."""

from __future__ import annotations

import json
import random
import statistics
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import httpx2
from websockets.sync.client import connect

from tests.benchmarks.measure import Measurement
from tests.browser.serving import Server
from tests.browser.walkers import write_walkers
from tracker.sequences.rendering import ROOMS


def run(short: bool) -> Iterator[Measurement]:
    """Start it, then seek at random: step data and both pictures, idle and during a run."""
    with tempfile.TemporaryDirectory() as name:
        folder: Path | str = (
            write_walkers(Path(name) / "walkers") if short else next(reversed(ROOMS))
        )
        begin = time.perf_counter()
        server = Server(folder, None if not short else Path(name) / "cache", wait=False)
        yield Measurement("serve: the page answers", time.perf_counter() - begin, "s")
        server.wait(lambda state: state["run"]["done"] > 0, seconds=300.0)
        yield Measurement(
            "serve: the first steps are there",
            time.perf_counter() - begin,
            "s",
            "≤ 5 s once rendered",
        )
        try:
            if not short:
                server.wait_for_run(seconds=600.0)
            yield from _scrub(server, "idle", 40 if short else 150)
            if not short:
                change = {"changes": {"colour_phd.detection_probability": 0.79}}
                httpx2.patch(server.address + "api/parameters", json=change)
                yield from _scrub(server, "during a run", 100)
        finally:
            yield Measurement("serve: ends after Ctrl-C", server.stop(), "s", "≤ 2 s")


def _scrub(server: Server, when: str, seeks: int) -> Iterator[Measurement]:
    state = server.get("/api/state").json()["sequence"]
    rng = random.Random(1)
    data, pictures = [], []
    with (
        connect(server.address.replace("http", "ws") + "api/stream", max_size=None) as socket,
        httpx2.Client(base_url=server.address) as client,
    ):
        step = state["frames"] // 2
        for _ in range(seeks):
            step = (step + rng.randrange(1, state["frames"])) % state["frames"]  # never the same
            begin = time.perf_counter()
            socket.send(json.dumps({"type": "seek", "step": step, "origin": "benchmark"}))
            while True:
                message = json.loads(socket.recv(timeout=30.0))
                if message["type"] == "step" and message["step"] == step:
                    break
            data.append(time.perf_counter() - begin)
            for camera in range(len(state["cameras"])):
                client.get(f"api/picture/{state['key']}/{camera}/{step}.jpg").read()
            pictures.append(time.perf_counter() - begin)
    for what, times in (("results", data), ("results and pictures", pictures)):
        p95 = statistics.quantiles(times, n=20)[-1] * 1000.0
        yield Measurement(f"scrub at random, {when}: {what}, 95 %", p95, "ms", "≤ 100 ms")
