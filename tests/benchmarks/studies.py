"""Studies: how busy the workers are, what a trial costs beside its runs, and how that grows."""

from __future__ import annotations

import json
import logging
import sqlite3
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from tests.benchmarks.measure import Measurement
from tests.conftest import DATA
from tests.synthetic import write_sequence
from tracker.studies import worker
from tracker.studies.cluster import DaskCrew
from tracker.studies.definition import StudyDefinition, definition_of
from tracker.studies.jobs import Job, Outcome
from tracker.studies.recordings import open_recordings
from tracker.studies.runner import run_study
from tracker.studies.store import RESULTS, Store, create

RECORDINGS = ("cmc1", "cmc2", "av163-seq45-3p-1111-points")
WORKERS = 2
THREADS = 64
SLEEP = 1.0
"""Seconds of a run that is a sleep."""

PARAMETERS: dict[str, Any] = {
    "fusion.detection_probability": {"low": 0.85, "high": 0.99},
    "fusion.clutter_rate": {"low": 0.5, "high": 8.0, "log": True},
    "fusion.acceleration_sigma": {"low": 0.3, "high": 2.0},
}


def run(short: bool) -> Iterator[Measurement]:
    """A study of three recordings on two workers, then its runs in a loop written by hand."""
    if all((DATA / name).is_dir() for name in RECORDINGS):
        yield from _real(6 if short else 300)


def crowd(short: bool) -> Iterator[Measurement]:
    """Trials that sleep on many threads."""
    growth = [(1000, "random"), (3000, "random"), (10_000, "random"), (3000, "tpe")]
    for trials, search in [(300, "random")] if short else growth:
        busy, beside = _asleep(trials, search)
        words = f"{trials} trials that sleep {SLEEP:g} s, {search}, {THREADS} threads"
        yield Measurement(f"studies: busy, {words}", busy, "share", "≥ 0.9", better="higher")
        yield Measurement(f"studies: the asker's time a trial, {words}", beside * 1e3, "ms")


def _definition(folder: Path, recordings: list[str], trials: int, search: str) -> StudyDefinition:
    fields = {
        "name": f"{trials} {search}",
        "recordings": recordings,
        "trials": trials,
        "objectives": ["score"],
        "search": search,
        "prune": False,
        "parameters": PARAMETERS,
    }
    return definition_of(fields, where="benchmark", folder=folder)


def _sleep(job: Job) -> Outcome:
    time.sleep(SLEEP)
    rate = float(dict(job.values).get("fusion.clutter_rate", 3.0))
    return Outcome(job.key, "done", figures={"score": 1.0 / rate}, seconds=SLEEP)


def _asleep(trials: int, search: str = "random") -> tuple[float, float]:
    """Share of the threads' time that is slept, and the asker's processor time a trial."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_sequence(folder / "r", frames=8, container=None, detections=True, templates=False)
        store = create(_definition(folder, ["r"], trials, search), folder / "studies")
        with DaskCrew(workers=THREADS, processes=False, do=_sleep) as crew:
            begin, own = 0.0, 0.0

            def ready(tell: object) -> DaskCrew:
                nonlocal begin, own
                begin, own = time.time(), time.process_time()
                return crew

            with store.running() as writer:
                run_study(store, writer, ready)
            own = time.process_time() - own
            seconds = max(one.ended for one in store.trials()) - begin
    return trials * SLEEP / (seconds * THREADS), own / trials


def _warm(crew: DaskCrew, store: Store) -> None:
    """Every worker has opened every recording and loaded its kernels."""
    recordings = open_recordings(store.definition())
    jobs = [
        recordings.job(one, {}, 1000 + number)
        for number in range(2 * WORKERS)
        for one in recordings.every
    ]
    for job in jobs:
        crew.submit(job)
    left = {job.key for job in jobs}
    while left:
        left -= {outcome.key for outcome in crew.finished(1.0)}


def _real(trials: int) -> Iterator[Measurement]:
    """A study of three recordings, and the same runs by joblib."""
    words = f"{trials} trials on 3 recordings, {WORKERS} workers"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        places = [str(DATA / one) for one in RECORDINGS]
        store = create(_definition(folder, places, trials, "tpe"), folder / "studies")
        with DaskCrew(workers=WORKERS) as crew, _Memory() as memory:
            _warm(crew, store)
            begin = 0.0

            def ready(tell: object) -> DaskCrew:
                nonlocal begin
                begin = time.time()  # once warm: the recordings are open
                return crew

            with store.running() as writer:
                run_study(store, writer, ready)
            whole = time.time() - begin
        found = store.trials()
        end = max(one.ended for one in found)
        seconds, worked = end - begin, sum(one.seconds for one in found)
        yield Measurement(f"studies: a trial, {words}", seconds / trials, "s")
        yield Measurement(
            f"studies: busy, {words}", worked / (WORKERS * seconds), "share", "≥ 0.85",
            better="higher",
        )  # fmt: skip
        idle = sum(end - last for last in _last_runs(store))
        beside = (WORKERS * seconds - worked - idle) / trials
        yield Measurement(f"studies: beside the runs, {words}", beside * 1e3, "ms/trial", "≤ 30 ms")
        yield Measurement(f"studies: no run left for a worker, {words}", idle, "s")
        words_after = f"studies: from the last trial to the end, {words}"
        yield Measurement(words_after, whole - seconds, "s")
        first, middle, last = memory.thirds(begin, end)
        for third, size in (("first", first), ("middle", middle), ("last", last)):
            yield Measurement(f"studies: memory in the {third} third, {words}", size / 1e6, "MB")
        yield Measurement(f"studies: memory's growth, {words}", (last - middle) / 1e6, "MB")
        recordings = open_recordings(store.definition())
        jobs = [
            job for one in found for _, job in recordings.jobs(one.values if one.number else {})
        ]
        by_hand = _by_hand(jobs)
        yield Measurement(
            f"studies: against joblib by hand, {words}", by_hand / whole, "×", "≥ 1/1.1"
        )


def _last_runs(store: Store) -> list[float]:
    """When the last run of each worker had come back; seconds since 1970."""
    ended: dict[str, float] = {}
    with closing(sqlite3.connect(store.folder / RESULTS)) as results:
        for outcome, kept in results.execute("SELECT outcome, ended FROM jobs"):
            worker = json.loads(outcome)["worker"]
            ended[worker] = max(kept, ended.get(worker, 0.0))
    return list(ended.values())


def _by_hand(jobs: list[Job]) -> float:
    """Seconds of the same runs in a loop of joblib, its processes warm."""
    from joblib import Parallel, delayed

    with Parallel(n_jobs=WORKERS, backend="loky", batch_size=1) as parallel:
        parallel(delayed(worker.work)(job) for job in jobs[: 2 * WORKERS * len(RECORDINGS)])
        begin = time.perf_counter()
        parallel(delayed(worker.work)(job) for job in jobs)
        return time.perf_counter() - begin


class _Memory:
    """Memory of this process and of those below it, over time."""

    def __enter__(self) -> _Memory:
        self._samples: list[tuple[float, float]] = []
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._look, daemon=True)
        self._thread.start()
        return self

    def _look(self) -> None:
        here = psutil.Process()
        while not self._ended.wait(0.5):
            total = 0.0
            for process in (here, *here.children(recursive=True)):
                try:
                    total += process.memory_info().rss
                except psutil.NoSuchProcess:
                    continue
            self._samples.append((time.time(), total))

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()

    def thirds(self, begin: float, end: float) -> list[float]:
        """Mean bytes in each third of the time between."""
        found = [size for at, size in self._samples if begin <= at <= end]
        return [float(np.mean(part)) for part in np.array_split(found, 3)]


logging.getLogger("distributed").setLevel(logging.CRITICAL)
