"""Small studies, and a crew that does their jobs in the test's own process."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tests.synthetic import write_sequence
from tracker.studies import worker
from tracker.studies.cluster import WorkerState
from tracker.studies.definition import StudyDefinition, definition_of
from tracker.studies.jobs import Job, Outcome
from tracker.studies.store import Store

PARAMETERS: dict[str, Any] = {
    "fusion.detection_probability": {"low": 0.6, "high": 0.98},
    "fusion.clutter_rate": {"low": 0.1, "high": 10.0, "log": True},
}


def recording(folder: Path, *, truth: bool = True, frames: int = 24) -> Path:
    """A recording of boxes alone, which is tracked in a moment."""
    return write_sequence(
        folder, frames=frames, container=None, detections=True, templates=False, truth=truth
    )


def definition(folder: Path, name: str = "small", **fields: Any) -> StudyDefinition:
    """A study of a recording that it makes."""
    place = folder / "recording"
    if not place.exists():
        recording(place)
    found = {
        "name": name,
        "recordings": ["recording"],
        "trials": 6,
        "objectives": ["score"],
        "parameters": PARAMETERS,
        **fields,
    }
    return definition_of(found, where="study.toml", folder=folder)


class Serial:
    """One worker, this process; it counts what it does."""

    slots = 1

    def __init__(self, do: Callable[[Job], Outcome] = worker.work, stop_after: int = 10**9) -> None:
        self.done: list[str] = []
        self._do = do
        self._stop_after = stop_after
        self._waiting: deque[Job] = deque()

    def submit(self, job: Job, priority: int = 0) -> None:
        self._waiting.append(job)

    def finished(self, seconds: float) -> list[Outcome]:
        if not self._waiting:
            return []
        if len(self.done) >= self._stop_after:
            raise KeyboardInterrupt
        job = self._waiting.popleft()
        self.done.append(job.key)
        return [self._do(job)]

    def workers(self) -> list[WorkerState]:
        return [WorkerState("here", "here", "", None, 0.0)]


def run(store: Store, crew: Serial, **how: Any) -> Any:
    """A study run by a crew."""
    from tracker.studies.runner import run_study

    with store.running() as writer:
        return run_study(store, writer, lambda tell: crew, **how)


def made_up(score: Callable[[dict[str, Any]], float]) -> Callable[[Job], Outcome]:
    """Outcomes whose score is a function of the values."""

    def do(job: Job) -> Outcome:
        value = score(dict(job.values))
        figures = {"score": value, "hota": value, "idf1": value, "speed": 100.0, "identity": value}
        return Outcome(job.key, "done", figures=figures, overlap=0.5, tracks=job.key, seconds=0.01)

    return do
