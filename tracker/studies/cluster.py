"""Workers by Dask: a cluster of processes on this machine, or an existing cluster.

Dask distributes the jobs, and restarts and counts the workers. This module submits the jobs, sends
recordings to workers that cannot read them, and collects the reports of workers.
"""

from __future__ import annotations

import importlib
import logging
import queue
import re
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import CancelledError
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Protocol

from tracker.files.text import visible
from tracker.runs.processes import available_cores
from tracker.runs.warm_up import ensure_compiled
from tracker.studies import transfer, worker
from tracker.studies.errors import StudyError
from tracker.studies.jobs import Job, Outcome
from tracker.studies.worker import Tell

ADDRESS = "DASK_SCHEDULER_ADDRESS"
"""The environment variable with the scheduler's address, if none is named."""

TOPIC = "multiview-phd"
"""The topic of Dask's events by which workers report their progress."""

LOOK_SECONDS = 2.0
"""Least interval between two queries of the scheduler for its workers, seconds."""

CONNECT_SECONDS = 10.0
"""Longest wait for a connection, seconds."""

SENDING_SECONDS = 600.0
"""Longest time for sending a recording, seconds."""

_QUIET = {
    "distributed.worker.profile.enabled": False,  # samples every worker a hundred times a second
    "distributed.admin.tick.interval": "1 s",  # by default fifty times a second
    "distributed.admin.tick.limit": "1 minute",
    "distributed.admin.system-monitor.interval": "10 s",
}
"""Settings that reduce what Dask collects for its dashboard, which is not used here; with many
workers it would take much of the scheduler's time."""

MOST_A_CORE = 4
"""Largest number of processes for each core; more would wait for each other, and each takes up to
1 GB of memory."""


@dataclass(frozen=True, slots=True)
class WorkerState:
    """The state of a worker by its last report."""

    name: str
    """The address of the worker, as its name."""
    machine: str
    """The name of the worker's machine."""
    words: str
    """The activity that is not a job, or what the worker waits for; empty while it does a job."""
    job: str | None
    """The key of the worker's job; None if it has none."""
    since: float
    """The time of the report, seconds since 1970."""


class Crew(Protocol):
    """The workers that do the jobs of a study."""

    @property
    def slots(self) -> int:
        """The number of jobs that are done at a time, at least 1."""

    def submit(self, job: Job, priority: int = 0) -> None:
        """Submit a job; jobs of higher priority are done first."""

    def finished(self, seconds: float) -> list[Outcome]:
        """Return the outcomes of jobs that ended since the last call.

        Args:
            seconds: Longest wait for the first outcome, seconds.

        Raises:
            StudyError: If the crew cannot continue; earlier outcomes are not lost.
        """

    def workers(self) -> list[WorkerState]:
        """Return the states of all workers."""


def worker_count(wanted: int | None) -> int:
    """Return the number of workers for this machine: the number wanted, or one for each core if
    None.

    Raises:
        StudyError: If more are wanted than the machine can run.
    """
    cores = available_cores()
    most = MOST_A_CORE * cores
    if wanted is not None and not 1 <= wanted <= most:
        raise StudyError(
            f"workers: expected 1 to {most} processes on this machine of {cores} cores, got "
            f"{wanted}; a cluster's scheduler takes more (--scheduler)"
        )
    return wanted or cores


def _do(job: Job) -> Outcome:
    """Do a job as a task of Dask, and report its progress as events."""
    from distributed import get_worker

    here = get_worker()
    name = str(here.address)

    def tell(words: str) -> None:
        event = {"worker": name, "words": words, "job": job.key, "machine": worker.machine()}
        here.log_event(TOPIC, event)

    tell("")
    return worker.work(job, tell, name)


def scheduler_numbers(address: str, seconds: float) -> dict[str, Any]:
    """Return the numbers of ``workers`` and ``threads`` of a scheduler, and the names of its
    ``machines``.

    Args:
        address: The scheduler's address.
        seconds: Longest wait for a connection, seconds.

    Raises:
        StudyError: If the address is not valid, or there is no scheduler.
    """
    check_address(address)
    distributed: Any = importlib.import_module("distributed")  # slow, and without types
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    try:
        with distributed.Client(address, timeout=seconds, set_as_default=False) as client:
            workers = client.scheduler_info(n_workers=-1).get("workers", {})
    except (OSError, TimeoutError, ValueError) as error:
        raise _no_scheduler(address, error) from None
    return {
        "workers": len(workers),
        "threads": sum(int(about.get("nthreads", 1)) for about in workers.values()),
        "machines": sorted({str(about.get("host", "")) for about in workers.values()}),
    }


def check_address(address: str) -> None:
    """Check that a text has the form of a scheduler's address, since Dask raises various exceptions
    for other texts.

    Raises:
        StudyError: If the text does not have this form.
    """
    found = re.fullmatch(
        r"(?:[a-z]+://)?(?:[A-Za-z0-9._-]+|\[[0-9A-Fa-f:.]+\]):(\d{1,5})/?", address
    )
    if found is None or not 0 < int(found[1]) < 65536:
        raise StudyError(
            f"scheduler: expected an address as tcp://10.0.0.1:8786, got {visible(address)!r}"
        )


def _no_scheduler(address: str | None, error: Exception) -> StudyError:
    """Return the error that there is no scheduler at an address."""
    return StudyError(
        f"there is no Dask scheduler at {address} ({_words(error)}); start one by "
        "`dask scheduler`, or name another address; to work on this machine, leave out "
        f"--scheduler and ${ADDRESS}"
    )


class DaskCrew:
    """A crew whose jobs are tasks of a Dask cluster; closed by :meth:`close` or at the end of
    ``with``."""

    def __init__(
        self,
        scheduler: str | None = None,
        *,
        workers: int | None = None,
        tell: Tell = lambda words: None,
        do: Callable[[Job], Outcome] = _do,
        processes: bool = True,
    ) -> None:
        """Start workers on this machine, or join a cluster.

        Args:
            scheduler: The address of an existing scheduler; None for workers on this machine.
            workers: The number of workers on this machine; one for each core if None.
            tell: A callback that gets a sentence on the progress.
            do: The function with which a worker does a job.
            processes: Whether the workers of this machine are processes rather than threads.

        Raises:
            StudyError: If there is no scheduler at the address.
        """
        distributed: Any = importlib.import_module("distributed")  # slow, and without types

        for name in ("distributed", "distributed.worker", "distributed.nanny"):
            logging.getLogger(name).setLevel(logging.CRITICAL)
        self._do, self._address = do, scheduler
        self._jobs: dict[Any, Job] = {}
        """The jobs that have not ended, by their futures."""
        self._states: dict[str, WorkerState] = {}
        self._lock = threading.Lock()
        self._sent: set[tuple[str, str]] = set()
        self._cluster: Any = None
        self._there: dict[str, int] = {}
        self._looked = float("-inf")
        self._closed = False
        if scheduler is None:
            self._cluster = self._start(
                worker_count(workers) if processes else workers or available_cores(),
                processes,
                tell,
            )
        else:
            check_address(scheduler)
        target = scheduler if scheduler is not None else self._cluster
        try:
            self._client: Any = distributed.Client(
                target, timeout=CONNECT_SECONDS, set_as_default=False
            )
        except (OSError, TimeoutError, ValueError) as error:
            self.close()
            raise _no_scheduler(scheduler, error) from None
        # results are transferred in the background
        self._ended: Any = distributed.as_completed(
            loop=self._client.loop, with_results=True, raise_errors=False
        )
        self._client.subscribe_topic(TOPIC, self._on_report)

    def _start(self, count: int, processes: bool, tell: Tell) -> Any:
        """Start the workers of this machine, and return their cluster.

        Args:
            count: The number of workers.
            processes: Whether the workers are processes rather than threads.
            tell: A callback that gets a sentence on the progress.
        """
        distributed: Any = importlib.import_module("distributed")  # slow, and without types
        dask: Any = importlib.import_module("dask")
        if processes:
            ensure_compiled(tell)
        tell(f"starting {count} worker{'s' if count > 1 else ''}")
        own = {"preload": ["tracker.studies.worker"]} if processes else {}
        environment = {"NUMBA_NUM_THREADS": "1"}
        with dask.config.set(_QUIET):
            return distributed.LocalCluster(
                n_workers=count,
                threads_per_worker=1,
                processes=processes,
                dashboard_address="127.0.0.1:0",  # Dask always starts a dashboard
                memory_limit=0,  # the memory of a run is bounded by its recording
                silence_logs=logging.CRITICAL,
                **({"env": environment} if processes else {}),
                **own,
            )

    def __enter__(self) -> DaskCrew:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the workers of this machine, or withdraw the jobs from another cluster."""
        self._closed = True
        client = getattr(self, "_client", None)
        if client is not None:
            client.close(timeout=5.0)
        if self._cluster is not None:
            self._cluster.close(timeout=10.0)

    @property
    def slots(self) -> int:
        """The number of jobs that are done at a time, at least 1."""
        return max(1, sum(self._threads().values()))

    def _threads(self) -> Mapping[str, int]:
        """Return the number of threads of each worker by address, which is at most
        :data:`LOOK_SECONDS` old, since the query is slow."""
        if time.monotonic() - self._looked >= LOOK_SECONDS:
            with self._explained():
                workers = self._client.scheduler_info(n_workers=-1).get("workers", {})
            self._there = {one: int(about.get("nthreads", 1)) for one, about in workers.items()}
            self._looked = time.monotonic()
        return self._there

    def submit(self, job: Job, priority: int = 0) -> None:
        """Submit a job; jobs of higher priority are done first."""
        with self._explained():
            future = self._client.submit(
                self._do, job, key=f"{TOPIC}-{job.key}-{time.monotonic_ns()}",
                pure=False, priority=priority, retries=0,
            )  # fmt: skip
        self._jobs[future] = job
        self._ended.add(future)

    def finished(self, seconds: float) -> list[Outcome]:
        """Return the outcomes of jobs that ended since the last call.

        Args:
            seconds: Longest wait for the first outcome, seconds.

        Raises:
            StudyError: If the scheduler is gone, or if a worker has another version of the program
                or cannot get a recording.
        """
        found: list[Outcome] = []
        until = time.monotonic() + seconds
        while True:
            left = 0.0 if found else max(0.0, until - time.monotonic())
            try:
                future, result = self._ended.queue.get(block=left > 0.0, timeout=left or None)
            except queue.Empty:
                return found
            outcome = self._outcome(self._jobs.pop(future), future.status, result)
            if outcome is not None:
                found.append(outcome)

    def _gone(self) -> StudyError:
        """Return the error that the scheduler is gone."""
        return StudyError(
            f"the scheduler at {self._address or 'this machine'} is gone; every run that ended is "
            "kept: start it again and go on by `multiview-phd study resume`"
        )

    @contextmanager
    def _explained(self) -> Iterator[None]:
        """Replace the exceptions that Dask raises if its scheduler is gone by one error."""
        try:
            yield
        except (OSError, TimeoutError, RuntimeError, CancelledError) as error:
            raise self._gone() from error

    def _outcome(self, job: Job, status: str, result: Any) -> Outcome | None:
        """Return the outcome of a job; None if the job is submitted again.

        Args:
            job: The job.
            status: The status of Dask's future.
            result: The outcome, or the exception as Dask returns it.
        """
        if status == "error":
            error = result[1]
            words = _words(error)
            if type(error).__name__ == "KilledWorker":
                words = "every worker that tried it died: it takes too much memory, or crashes"
            elif isinstance(error, ImportError):
                raise StudyError(
                    f"a worker of {self._address} does not have this program ({words}); install "
                    "multiview-phd of the same version there"
                )
            return Outcome(job.key, "failed", words)
        if status != "finished":  # cancelled or lost, since the connection is broken
            raise self._gone()
        outcome: Outcome = result
        if outcome.became == "version":
            raise StudyError(
                f"worker {outcome.worker} on {outcome.machine} has another version of the program "
                f"(code {outcome.words}, here {job.code}); install the same one there, with the "
                "same NumPy, SciPy, OpenCV and Numba"
            )
        if outcome.became == "unreadable":
            self._send(job, outcome)
            self.submit(job, priority=1)
            return None
        return outcome

    def _send(self, job: Job, outcome: Outcome) -> None:
        """Send a recording to the machine of a worker that cannot read it."""
        if (job.content, outcome.worker) in self._sent:
            raise StudyError(
                f"worker {outcome.worker} cannot read {job.place} though it was sent there "
                f"({outcome.words})"
            )
        self._sent.add((job.content, outcome.worker))
        try:
            from tracker.sequences.library import open_sequence

            data = transfer.packed(open_sequence(job.place).folder)
        except (StudyError, OSError) as error:
            raise StudyError(
                f"worker {outcome.worker} on {outcome.machine} cannot read {job.place} "
                f"({outcome.words}), and {_words(error)}"
            ) from None
        with self._explained():
            sent = self._client.submit(
                transfer.unpack, job.content, data, workers=[outcome.worker], pure=False
            )
            sent.result(timeout=SENDING_SECONDS)

    def _on_report(self, event: tuple[float, Any]) -> None:
        """Store the report of a worker, which Dask passes with its time."""
        _, report = event
        with self._lock:
            self._states[report["worker"]] = WorkerState(
                report["worker"], report["machine"], report["words"], report["job"], time.time()
            )

    def workers(self) -> list[WorkerState]:
        """Return the states of all workers."""
        if self._closed:
            return []
        there = self._threads()
        with self._lock:
            known = dict(self._states)
        return [
            known.get(name, WorkerState(name, "", "waits for its first job", None, time.time()))
            for name in sorted(there)
        ]


def _words(error: BaseException | None) -> str:
    """Return the message of an exception on one line, or else the name of its type."""
    return " ".join(str(error).split()) or type(error).__name__
