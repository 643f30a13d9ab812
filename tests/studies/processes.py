"""Studies with real processes: the program, its workers, a scheduler; and killing them."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tracker.studies.store import Store

ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}


def command(*words: str) -> list[str]:
    """The program with some words."""
    return [sys.executable, "-m", "app", *words]


def start(store: Store, *words: str) -> subprocess.Popen[bytes]:
    """The program runs a study."""
    log = (store.folder / "said.txt").open("ab")
    with log:
        return subprocess.Popen(
            command("study", "resume", str(store.folder), *words), stdout=log, stderr=log
        )


def finish(store: Store, *words: str) -> str:
    """The program runs a study to its end; what it said."""
    done = subprocess.run(
        command("study", "resume", str(store.folder), *words),
        capture_output=True, text=True, timeout=900,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout + done.stderr


def wait(holds: Callable[[], Any], seconds: float = 300.0) -> Any:
    """Wait for something that another process brings about."""
    until = time.monotonic() + seconds
    while not (found := holds()):
        assert time.monotonic() < until, "it did not come about in time"
        time.sleep(0.02)
    return found


def kill(number: int) -> None:
    """As the system does when memory runs out."""
    os.kill(number, signal.SIGKILL)


def workers_of(number: int) -> list[int]:
    """The worker processes below a process, however far."""
    below: dict[int, list[int]] = {}
    lines: dict[int, str] = {}
    for place in Path("/proc").iterdir():
        if place.name.isdecimal():
            try:
                parent = int((place / "stat").read_text().rpartition(")")[2].split()[1])
                lines[int(place.name)] = (place / "cmdline").read_text().replace("\0", " ")
            except OSError:
                continue
            below.setdefault(parent, []).append(int(place.name))
    found, left = [], [number]
    while left:
        for child in below.get(left.pop(), []):
            left.append(child)
            if "spawn_main" in lines.get(child, ""):
                found.append(child)
    return found


@contextmanager
def cluster(
    workers: int = 2, *, where: Path
) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """A scheduler and workers, started by hand; its address, and the processes."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address = f"tcp://127.0.0.1:{port}"
    quiet: dict[str, Any] = {
        "stdout": subprocess.DEVNULL,
        "stderr": subprocess.DEVNULL,
        "env": {**os.environ, **ONE_THREAD},
        "cwd": where,
    }
    dask = [sys.executable, "-m", "distributed.cli.dask_scheduler"]
    worker = [sys.executable, "-m", "distributed.cli.dask_worker", address]
    processes = [
        subprocess.Popen(
            [*dask, "--host", "127.0.0.1", "--port", str(port), "--no-dashboard"], **quiet
        )
    ]
    for _ in range(workers):
        line = [*worker, "--nthreads", "1", "--no-nanny", "--memory-limit", "0", "--no-dashboard"]
        processes.append(subprocess.Popen(line, **quiet))
    try:
        yield address, processes
    finally:
        for process in processes:
            process.kill()
            process.wait()


def outcomes(store: Store) -> dict[str, dict[str, Any]]:
    """Every run that ended, but for when and by whom."""
    import sqlite3

    connection = sqlite3.connect(store.folder / "results.sqlite3")
    rows = connection.execute("SELECT key, outcome FROM jobs").fetchall()
    connection.close()
    found = {}
    for key, text in rows:
        told = json.loads(text)
        figures = {k: v for k, v in told["figures"].items() if k != "speed"}
        found[key] = {"figures": figures, "tracks": told["tracks"], "overlap": told["overlap"]}
    return found
