"""What a worker of this machine's own cluster does as it starts (a preload of Dask's)."""

from __future__ import annotations

from typing import Any

from tracker.studies.work import working


def dask_setup(worker: Any) -> None:
    """Give way to whoever uses the machine, and have all imported before the first job."""
    working.give_way()
    working.prepare()
