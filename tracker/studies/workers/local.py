"""The workers of this machine: their number, and their preparation by Dask's preload."""

from __future__ import annotations

from typing import Any

from tracker.runs.processes import available_cores
from tracker.studies.errors import StudyError
from tracker.studies.workers import working

MOST_A_CORE = 4
"""Largest number of processes for each core; more would wait for each other, and each takes up to
1 GB of memory."""


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


def dask_setup(worker: Any) -> None:
    """Lower the priority of the worker's process, and compile its kernels before the first job."""
    working.lower_priority()
    working.prepare()
