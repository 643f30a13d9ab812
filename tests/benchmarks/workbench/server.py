"""The real server: how long until the page can be used, and how long a scrub takes."""

from __future__ import annotations

import json
import random
import statistics
import tempfile
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import httpx2
import psutil
from websockets.sync.client import connect

from tests.benchmarks.measure import Measurement
from tests.browser.serving import Server
from tests.browser.walkers import write_walkers


def run(short: bool) -> Iterator[Measurement]:
    """Start it, then seek at random: step data and both pictures, idle and during a run."""
    with tempfile.TemporaryDirectory() as name:
        folder: Path | str = write_walkers(Path(name) / "walkers") if short else "room44-3p"
        begin = time.perf_counter()
        server = Server(folder, None if not short else Path(name) / "cache", wait=False)
        yield Measurement("serve: the page answers", time.perf_counter() - begin, "s")
        server.wait(lambda state: state["run"]["done"] > 0, seconds=300.0)
        yield Measurement(
            "serve: the first steps are there",
            time.perf_counter() - begin,
            "s",
            "≤ 5 s",
        )
        try:
            if not short:
                server.wait_for_run(seconds=600.0)
            yield from _scrub(server, "idle", 40 if short else 150)
            yield from _play(server, 2.0 if short else 8.0)
            if not short:
                changes = {"colour_phd.detection_probability": 0.79}
                server.command("set_parameters", changes=changes)
                yield from _scrub(server, "during a run", 100)
            yield from _kill(server, 2 if short else 10)
        finally:
            yield Measurement("serve: ends after Ctrl-C", server.stop(), "s", "≤ 2 s")


def _kill(server: Server, kills: int) -> Iterator[Measurement]:
    """Kill it while it computes and keeps what it computed: how soon it answers again."""
    rng = random.Random(2)
    answers, people, processor = [], [], []
    for kill in range(kills):
        changes = {"fusion.survival_probability": round(0.9 + 0.005 * kill, 3)}
        server.command("set_parameters", changes=changes)
        time.sleep(rng.uniform(0.0, 1.0))
        server.kill()
        begin = time.perf_counter()
        server.start()
        assert server.get("/api/state").status_code == 200
        answers.append(time.perf_counter() - begin)
        times = [each.cpu_times() for each in (psutil.Process(server.process.pid), server.serving)]
        processor.append(sum(each.user + each.system for each in times))
        server.wait(lambda state: state["run"]["done"] > 0)
        people.append(time.perf_counter() - begin)
    yield Measurement("serve: answers again after kill -9, worst", max(answers), "s", "≤ 5 s")
    yield Measurement("serve: shows people again after kill -9, worst", max(people), "s", "≤ 5 s")
    yield Measurement(
        "serve: answers again after kill -9: processor time", statistics.median(processor), "s"
    )


def _scrub(server: Server, when: str, seeks: int) -> Iterator[Measurement]:
    state = server.get("/api/state").json()["sequence"]
    rng = random.Random(1)
    data, pictures = [], []
    with (
        connect(server.address.replace("http", "ws") + "api/stream", max_size=None) as socket,
        httpx2.Client(base_url=server.address) as client,
        ThreadPoolExecutor(len(state["cameras"])) as pool,  # a page asks for all at once
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
            addresses = [
                f"api/picture/{state['key']}/{camera}/{step}.jpg"
                for camera in range(len(state["cameras"]))
            ]
            list(pool.map(lambda address: client.get(address).read(), addresses))
            pictures.append(time.perf_counter() - begin)
    for what, times in (("results", data), ("results and pictures", pictures)):
        p95 = statistics.quantiles(times, n=20)[-1] * 1000.0
        yield Measurement(f"scrub at random, {when}: {what}, 95 %", p95, "ms", "≤ 100 ms")


PAGES = 4
STEPS_A_SECOND = 25.0


def _play(server: Server, seconds: float) -> Iterator[Measurement]:
    """One page plays and three look on: how many of the steps each is told of, and how late."""
    frames = server.get("/api/state").json()["sequence"]["frames"]
    sent: dict[int, float] = {}
    late: list[list[float]] = [[] for _ in range(PAGES)]
    ends = threading.Event()
    address = server.address.replace("http", "ws") + "api/stream"

    def look(page: int) -> None:
        with connect(address, max_size=None) as socket:
            while not ends.is_set():
                try:
                    message = json.loads(socket.recv(timeout=0.2))
                except TimeoutError:
                    continue
                if message["type"] == "step" and message["step"] in sent:
                    late[page].append(time.perf_counter() - sent[message["step"]])

    looking = [threading.Thread(target=look, args=(page,)) for page in range(PAGES)]
    for thread in looking:
        thread.start()
    count = min(int(seconds * STEPS_A_SECOND), frames - 1)
    with connect(address, max_size=None) as player:
        time.sleep(0.5)
        begin = time.perf_counter()
        for number in range(count):
            time.sleep(max(0.0, begin + number / STEPS_A_SECOND - time.perf_counter()))
            sent[number + 1] = time.perf_counter()
            player.send(json.dumps({"type": "seek", "step": number + 1, "origin": "benchmark"}))
        time.sleep(0.5)
    ends.set()
    for thread in looking:
        thread.join()
    dropped = 1.0 - min(len(times) for times in late) / count
    words = f"play at {STEPS_A_SECOND:g} steps/s, {PAGES} pages"
    yield Measurement(f"{words}: steps dropped by the worst", 100.0 * dropped, "%", "0 %")
    p95 = statistics.quantiles([value for times in late for value in times], n=20)[-1]
    yield Measurement(f"{words}: a step is told after, 95 %", 1000.0 * p95, "ms", "≤ 40 ms")
