"""The trials under way, and what each worker does for them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from tracker.studies.kept.records import JobRow
from tracker.studies.work.cluster import WorkerState
from tracker.studies.work.jobs import Job, Outcome


@dataclass(eq=False)
class Active:
    """A trial under way."""

    number: int
    values: dict[str, Any]
    jobs: list[tuple[JobRow, Job]]
    sent: int = 0
    wanted: int = 0
    """Different runs among those that were sent."""
    outcomes: dict[str, Outcome] = field(default_factory=dict)

    @property
    def is_back(self) -> bool:
        """Whether all runs that were sent have ended."""
        return len(self.outcomes) >= self.wanted


def at_work(
    workers: Iterable[WorkerState], waiting: Mapping[str, Sequence[Active]]
) -> list[dict[str, Any]]:
    """Each worker with the trial that it is at.

    Args:
        workers: As the crew tells them.
        waiting: The trials that wait for each run, by its key.
    """
    found = []
    for one in workers:
        told: dict[str, Any] = {"trial": None, "recording": None, "seed": None}
        for active in waiting.get(one.job or "", ())[:1]:
            row = next(row for row, _ in active.jobs if row.key == one.job)
            told = {"trial": active.number, "recording": row.recording, "seed": row.seed}
        words = one.words or ("" if told["trial"] is not None else "waits for a run")
        found.append(
            {"name": one.name, "machine": one.machine, "words": words, "since": one.since} | told
        )
    return found
