"""A machine that has never run it: imports, then a start with nothing compiled or rendered."""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from tests.benchmarks.measure import Measurement
from tests.browser.serving import Server

_IMPORT = """
import gc, time
begin = time.process_time()
gc.disable()  # as `serve` does it
import app.web.server
print(time.process_time() - begin)
"""


def run(short: bool) -> Iterator[Measurement]:
    """The web's import, and from the command to the first tracks with empty caches.

    The rendered room is the one that ``serve`` opens by itself. What the server tells it is
    waiting for is printed with the time at which it began to.
    """
    with tempfile.TemporaryDirectory() as name:
        _import_seconds(Path(name))
        seconds = [_import_seconds(Path(name)) for _ in range(3 if short else 7)]
    yield Measurement("import of the web: processor time", statistics.median(seconds), "s", "≤ 1 s")
    with tempfile.TemporaryDirectory() as name:
        cache = Path(name)
        begin = time.perf_counter()
        server = Server("room44-3p", cache, kernels=cache / "kernels", wait=False)
        yield Measurement("cold start: the page answers", time.perf_counter() - begin, "s")
        waits: list[str] = []

        def tracked(state: dict) -> bool:
            waiting = _waits_for(state)
            if waiting and waiting not in waits[-1:]:
                waits.append(waiting)
                print(f"  {time.perf_counter() - begin:5.1f} s  waits for: {waiting}", flush=True)
            return state["run"]["done"] > 0

        try:
            server.wait(tracked, seconds=300.0)
            yield Measurement(
                "cold start: the first tracks are there", time.perf_counter() - begin, "s", "≤ 30 s"
            )
        finally:
            server.stop()


def _import_seconds(bytecode: Path) -> float:
    """By an interpreter that keeps bytecode in that folder, as one does beside what is installed:
    the first to use it compiles everything."""
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    done = subprocess.run(
        [sys.executable, "-c", _IMPORT],
        capture_output=True,
        text=True,
        check=True,
        env={**environment, "PYTHONPYCACHEPREFIX": str(bytecode)},
    )
    return float(done.stdout)


def _waits_for(state: dict) -> str:
    """The server's own words for what is not there yet."""
    opening = state["opening"]
    return "reading" if opening else str(state["run"]["message"])
