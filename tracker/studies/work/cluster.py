"""Workers by Dask: a cluster of processes on this machine, or one that is there.

Everything that distributes, restarts and counts workers is Dask's. What is ours: a job is sent
under its own key, a recording goes where it cannot be read, and what a worker waits for is told.
"""

from __future__ import annotations

import importlib
import logging
import queue
import re
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import CancelledError
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Protocol

from tracker.files.text import visible
from tracker.kernels import compilation
from tracker.runs.processes import available_cores
from tracker.studies.errors import StudyError
from tracker.studies.work import recordings, working
from tracker.studies.work.jobs import Job, Outcome
from tracker.studies.work.local import how_many

ADDRESS = "DASK_SCHEDULER_ADDRESS"
"""Environment variable: the cluster's scheduler, where none is named."""

TOPIC = "multiview-phd"

LOOK_SECONDS = 2.0
"""How often the scheduler is asked who works for it."""

CONNECT_SECONDS = 10.0
SENDING_SECONDS = 600.0

_QUIET = {
    "distributed.worker.profile.enabled": False,  # looks at every worker a hundred times a second
    "distributed.admin.tick.interval": "1 s",  # else fifty times a second, in each worker
    "distributed.admin.tick.limit": "1 minute",
    "distributed.admin.system-monitor.interval": "10 s",
}
"""What Dask tells its dashboard; nobody looks there, and with many workers it takes the time that
the scheduler has for them."""

Told = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class WorkerState:
    """One worker as far as it has told."""

    name: str
    machine: str
    words: str
    """What it does or waits for."""
    job: str | None
    """Key of its job."""
    since: float
    """Seconds since 1970."""


class Crew(Protocol):
    """Who does the jobs."""

    @property
    def slots(self) -> int:
        """How many jobs are done at a time; at least 1."""

    def submit(self, job: Job, priority: int = 0) -> None:
        """Have a job done; of several those of higher priority come first."""

    def finished(self, seconds: float) -> list[Outcome]:
        """What has ended, waiting for the first so long.

        Raises:
            StudyError: If the crew cannot work on; nothing that ended before is lost.
        """

    def call(self, function: Callable[..., Any], *arguments: Any) -> Callable[[], Any | None]:
        """Have something else computed; what is given back has it once it is there."""

    def workers(self) -> list[WorkerState]:
        """All that there are."""


def compile_first(tell: Told) -> None:
    """Have this machine's kernels compiled before its workers start."""
    if not compilation.is_compiled():
        tell(working.COMPILING)
        line = [sys.executable, "-m", "tracker.runs.warm_up"]
        subprocess.run(line, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, check=False)


def _do(job: Job) -> Outcome:
    """A job as Dask's task."""
    from distributed import get_worker

    worker = get_worker()
    name = str(worker.address)

    def tell(words: str) -> None:
        told = {"worker": name, "words": words, "job": job.key, "machine": working.machine()}
        worker.log_event(TOPIC, told)

    tell("")
    return working.work(job, tell, name)


def look_at(address: str, seconds: float) -> dict[str, Any]:
    """Who works for a scheduler: ``workers``, ``threads``, ``machines``.

    Raises:
        StudyError: If there is none at the address, or it is none.
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
    """Whether a text may be a scheduler's address; what is none Dask may refuse by anything, an
    assertion included.

    Raises:
        StudyError: If it cannot be one.
    """
    found = re.fullmatch(
        r"(?:[a-z]+://)?(?:[A-Za-z0-9._-]+|\[[0-9A-Fa-f:.]+\]):(\d{1,5})/?", address
    )
    if found is None or not 0 < int(found[1]) < 65536:
        raise StudyError(
            f"scheduler: expected an address as tcp://10.0.0.1:8786, got {visible(address)!r}"
        )


def _no_scheduler(address: str | None, error: Exception) -> StudyError:
    return StudyError(
        f"there is no Dask scheduler at {address} ({_words(error)}); start one by "
        "`dask scheduler`, or name another address; to work on this machine, leave out "
        f"--scheduler and ${ADDRESS}"
    )


class DaskCrew:
    """Jobs as tasks of a Dask cluster; close it, or use ``with``."""

    def __init__(
        self,
        scheduler: str | None = None,
        *,
        workers: int | None = None,
        tell: Told = lambda words: None,
        do: Callable[[Job], Outcome] = _do,
        processes: bool = True,
        sent_bytes: int = recordings.SENT_BYTES,
    ) -> None:
        """Start workers on this machine, or join a cluster.

        Args:
            scheduler: Address of one that is there; None for this machine.
            workers: How many on this machine; as many as there are cores, if none is named.
            tell: Told what is being waited for.
            do: What a worker does with a job.
            processes: Whether the workers of this machine are processes rather than threads.
            sent_bytes: A recording up to this size is sent to a worker that cannot read it.

        Raises:
            StudyError: If there is no scheduler at the address.
        """
        distributed: Any = importlib.import_module("distributed")  # slow, and without types

        for name in ("distributed", "distributed.worker", "distributed.nanny"):
            logging.getLogger(name).setLevel(logging.CRITICAL)
        self._do, self._address, self._sent_bytes = do, scheduler, sent_bytes
        self._jobs: dict[Any, Job] = {}
        """Each job under way by its future."""
        self._states: dict[str, WorkerState] = {}
        self._lock = threading.Lock()
        self._sent: set[tuple[str, str]] = set()
        self._cluster: Any = None
        self._there: dict[str, int] = {}
        self._looked = float("-inf")
        self._closed = False
        if scheduler is None:
            self._cluster = self._start(
                how_many(workers) if processes else workers or available_cores(), processes, tell
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
        # results come over beside us, so that nobody waits for one after the other
        self._ended: Any = distributed.as_completed(
            loop=self._client.loop, with_results=True, raise_errors=False
        )
        self._client.subscribe_topic(TOPIC, self._heard)

    def _start(self, count: int, processes: bool, tell: Told) -> Any:
        distributed: Any = importlib.import_module("distributed")  # slow, and without types
        dask: Any = importlib.import_module("dask")
        if processes:
            compile_first(tell)
        tell(f"starting {count} worker{'s' if count > 1 else ''}")
        own = {"preload": ["tracker.studies.work.local"]} if processes else {}
        environment = {"NUMBA_NUM_THREADS": "1"}
        with dask.config.set(_QUIET):
            return distributed.LocalCluster(
                n_workers=count,
                threads_per_worker=1,
                processes=processes,
                dashboard_address="127.0.0.1:0",  # Dask has one in any case
                memory_limit=0,  # what a run takes is bounded by its recording
                silence_logs=logging.CRITICAL,
                **({"env": environment} if processes else {}),
                **own,
            )

    def __enter__(self) -> DaskCrew:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the workers of this machine; those of another cluster only forget our jobs."""
        self._closed = True
        client = getattr(self, "_client", None)
        if client is not None:
            client.close(timeout=5.0)
        if self._cluster is not None:
            self._cluster.close(timeout=10.0)

    @property
    def slots(self) -> int:
        """How many jobs are done at a time; at least 1."""
        return max(1, sum(self._threads().values()))

    def _threads(self) -> Mapping[str, int]:
        """Of each worker. The answer takes its time, in which nothing else can be done."""
        if time.monotonic() - self._looked >= LOOK_SECONDS:
            with self._asking():
                workers = self._client.scheduler_info(n_workers=-1).get("workers", {})
            self._there = {one: int(about.get("nthreads", 1)) for one, about in workers.items()}
            self._looked = time.monotonic()
        return self._there

    def submit(self, job: Job, priority: int = 0) -> None:
        """Have a job done; of several those of higher priority come first."""
        with self._asking():
            future = self._client.submit(
                self._do, job, key=f"{TOPIC}-{job.key}-{time.monotonic_ns()}",
                pure=False, priority=priority, retries=0,
            )  # fmt: skip
        self._jobs[future] = job
        self._ended.add(future)

    def finished(self, seconds: float) -> list[Outcome]:
        """What has ended, waiting for the first so long.

        Raises:
            StudyError: If the scheduler is gone, or a worker has another version or no recording.
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
        return StudyError(
            f"the scheduler at {self._address or 'this machine'} is gone; every run that ended is "
            "kept: start it again and go on by `multiview-phd study resume`"
        )

    @contextmanager
    def _asking(self) -> Iterator[None]:
        """Whatever Dask raises where its scheduler does not answer is told as one sentence."""
        try:
            yield
        except (OSError, TimeoutError, RuntimeError, CancelledError) as error:
            raise self._gone() from error

    def _outcome(self, job: Job, status: str, result: Any) -> Outcome | None:
        """What became of a job; None where it is sent once more."""
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
        if status != "finished":  # cancelled or lost, as all are when the connection breaks
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
        """Put a recording on the machine of a worker that cannot read it."""
        if (job.content, outcome.worker) in self._sent:
            raise StudyError(
                f"worker {outcome.worker} cannot read {job.place} though it was sent there "
                f"({outcome.words})"
            )
        self._sent.add((job.content, outcome.worker))
        try:
            from tracker.sequences.library import open_sequence

            data = recordings.packed(open_sequence(job.place).folder, self._sent_bytes)
        except (StudyError, OSError) as error:
            raise StudyError(
                f"worker {outcome.worker} on {outcome.machine} cannot read {job.place} "
                f"({outcome.words}), and {_words(error)}"
            ) from None
        with self._asking():
            sent = self._client.submit(
                recordings.unpack, job.content, data, workers=[outcome.worker], pure=False
            )
            sent.result(timeout=SENDING_SECONDS)

    def call(self, function: Callable[..., Any], *arguments: Any) -> Callable[[], Any | None]:
        """Have something else computed; what is given back has it once it is there.

        By the same worker each time, if it is there: one alone loads what that takes.
        """
        first = sorted(self._threads())[:1]
        with self._asking():
            future = self._client.submit(
                function, *arguments, pure=False, priority=10,
                workers=first or None, allow_other_workers=bool(first),
            )  # fmt: skip
        return lambda: future.result() if future.status == "finished" else None

    def _heard(self, event: tuple[float, Any]) -> None:
        _, told = event
        with self._lock:
            self._states[told["worker"]] = WorkerState(
                told["worker"], told["machine"], told["words"], told["job"], time.time()
            )

    def workers(self) -> list[WorkerState]:
        """All that there are."""
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
    return " ".join(str(error).split()) or type(error).__name__
