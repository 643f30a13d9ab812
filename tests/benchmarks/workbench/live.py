"""Tuning through the real server: from the last movement of a slider to what it says."""

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
from websockets.sync.client import ClientConnection, connect

from tests.app.conftest import command
from tests.app.folders import write_crossing
from tests.benchmarks.measure import Measurement
from tests.browser.serving import Server

STEPS = 500
MOVEMENTS = 10
BETWEEN_SECONDS = 0.05
"""viser throttles a slider to this."""


def run(short: bool) -> Iterator[Measurement]:
    """A recording of 500 steps and three cameras, its boxes given: drags at random playheads."""
    with tempfile.TemporaryDirectory() as name:
        folder = write_crossing(Path(name) / "crossing", STEPS)
        server = Server(folder, Path(name) / "cache")
        try:
            server.wait_for_run()
            address = server.address.replace("http", "ws") + "api/stream"
            with (
                connect(address, max_size=None) as socket,
                httpx2.Client(base_url=server.address) as client,
            ):
                yield from _drags(socket, client, 8 if short else 40)
                yield from _back(socket, client)
        finally:
            server.stop()


def _change(client: httpx2.Client, **values: float) -> str:
    """Change values of the fusion; the key of the run that they ask for."""
    changes = {f"fusion.{name}": value for name, value in values.items()}
    answer = command(client, "set_parameters", changes=changes).json()
    return str(answer["run"]["key"])


def _wait(socket: ClientConnection, key: str, step: int, begin: float) -> tuple[float, float]:
    """Milliseconds from ``begin`` until the shown step, and the whole run, are of this key."""
    shown = whole = 0.0
    while not (shown and whole):
        message: dict[str, Any] = json.loads(socket.recv(timeout=60.0))
        now = 1000.0 * (time.perf_counter() - begin)
        if message["type"] == "step" and message["computed"]:
            if (message["run"], message["step"]) == (key, step):
                shown = shown or now
        run = message["state"]["run"] if message["type"] == "state" else message.get("run")
        if isinstance(run, dict) and (run["key"], run["state"]) == (key, "done"):
            whole = now
    return shown, whole


def _drags(socket: ClientConnection, client: httpx2.Client, drags: int) -> Iterator[Measurement]:
    rng = random.Random(1)
    for parameter, low, aims in (
        ("detection_probability", 0.6, ("≤ 150 ms", "≤ 1000 ms")),
        ("extraction_threshold", 0.3, ("≤ 150 ms", "")),
    ):
        times = []
        for _ in range(drags):
            step = rng.randrange(STEPS)
            socket.send(json.dumps({"type": "seek", "step": step, "origin": "benchmark"}))
            base = rng.uniform(low, low + 0.25)
            for movement in range(MOVEMENTS):
                time.sleep(BETWEEN_SECONDS)
                begin = time.perf_counter()
                key = _change(client, **{parameter: round(base + 0.005 * movement, 4)})
            times.append(_wait(socket, key, step, begin))
        for what, aim, taken in zip(
            ("shown step", "whole run"), aims, zip(*times, strict=True), strict=True
        ):
            p95 = statistics.quantiles(taken, n=20)[-1]
            name = f"drag of {parameter}, {STEPS} steps: {what}"
            yield Measurement(f"{name}, median", statistics.median(taken), "ms")
            yield Measurement(f"{name}, 95 %", p95, "ms", aim)


def _back(socket: ClientConnection, client: httpx2.Client) -> Iterator[Measurement]:
    """Between two values that were both computed before."""
    times = []
    socket.send(json.dumps({"type": "seek", "step": STEPS - 1, "origin": "benchmark"}))
    for turn in range(10):
        begin = time.perf_counter()
        key = _change(client, detection_probability=(0.72, 0.88)[turn % 2])
        _, whole = _wait(socket, key, STEPS - 1, begin)
        if turn >= 2:
            times.append(whole)
    yield Measurement("back to earlier values: whole run", statistics.median(times), "ms")
