"""Workers of this machine: how many there may be, and what each does as it starts (a preload of
Dask's)."""

from __future__ import annotations

from typing import Any

from tracker.runs.processes import available_cores
from tracker.studies.errors import StudyError
from tracker.studies.work import working

MOST_A_CORE = 4
"""Processes for each core: more only wait for each other, and each takes up to a gigabyte."""


def how_many(wanted: int | None) -> int:
    """Workers of this machine: as many as are wanted, or one a core.

    Raises:
        StudyError: If they are more than it can bear.
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
    """Give way to whoever uses the machine, and have all imported before the first job."""
    working.give_way()
    working.prepare()
