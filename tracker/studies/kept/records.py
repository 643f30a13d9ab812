"""The stored records of a study: trials that ended, their runs, and the status."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Annotated, Any, Literal, Required

from pydantic import ConfigDict, Field
from typing_extensions import TypedDict

TrialState = Literal["complete", "pruned", "failed"]


@dataclass(frozen=True, slots=True)
class JobRow:
    """One run of a trial."""

    key: str
    """The key of the run's job."""
    recording: str
    """The name or folder of the recording."""
    seed: int


@dataclass(frozen=True, slots=True)
class Trial:
    """A trial that ended."""

    number: int
    state: TrialState
    values: dict[str, Any]
    """The varied parameters, by key."""
    objectives: tuple[float, ...] | None
    """Means of the objectives over recordings and seeds; None if the trial failed. Those of a
    pruned trial are means over its first runs."""
    spreads: tuple[float | None, ...]
    """Standard deviations of the objectives over the seeds."""
    figures: dict[str, float]
    """Means of all other figures over recordings and seeds."""
    vetoed: bool
    """Whether the tracks overlap too little with the boxes of cameras that were left out."""
    words: str
    """The reason of a failure or pruning, or a remark on the trial."""
    seconds: float
    """The time of its runs on the workers' clocks, seconds."""
    jobs: tuple[JobRow, ...]
    ended: float = 0.0
    """The time when it ended, seconds since 1970."""

    def to_json(self) -> dict[str, Any]:
        """Return all fields as plain values."""
        return asdict(self)


@dataclass(frozen=True, slots=True)
class Status:
    """The status of a study, as its process last wrote it.

    A session is the time from one start of the study to its next end or interruption.
    """

    state: Literal["new", "running", "stopped", "done", "failed"] = "new"
    words: str = ""
    """What the study waits for, or why it ended."""
    done: int = 0
    """The number of trials that ended."""
    trials: int = 0
    """The number of trials that the study has."""
    runs: int = 0
    """The number of runs computed in this session."""
    seconds: float = 0.0
    """The duration of this session, seconds."""
    seconds_left: float | None = None
    """The estimated time to the end, seconds; None if it is not known."""
    busy: float | None = None
    """Share of the workers' time in which they worked, since all had started."""
    workers: list[dict[str, Any]] = field(default_factory=list)
    all_runs: int = 0
    """The number of runs computed in all sessions together."""
    all_seconds: float = 0.0
    """The duration of all sessions together, seconds."""
    process: int = 0
    """The id of the process."""
    written: float = 0.0
    """The time when the status was written, seconds since 1970."""


class StoredOutcome(TypedDict, total=False):
    """The JSON of an outcome, made by :meth:`tracker.studies.work.jobs.Outcome.to_json`."""

    key: Required[str]
    became: Required[Literal["done", "failed", "unreadable", "version"]]
    words: str
    figures: dict[str, float | None]
    overlap: float | None
    tracks: str
    people: int
    seconds: float
    worker: str
    machine: str


class _Importance(TypedDict):
    trials: int
    shares: dict[str, tuple[float, float]]


class _Objective(TypedDict):
    key: str


class _Recording(TypedDict):
    __pydantic_config__ = ConfigDict(extra="allow")  # type: ignore[misc]  # how pydantic asks it

    place: str
    content: str


STORED: dict[str, Any] = {
    "spent": float,
    "code": str,
    "recordings": list[_Recording],
    "objectives": Annotated[list[_Objective], Field(min_length=1)],
    "importance": _Importance,
    "tuned": dict[str, Any],
}
"""The types of the facts that are stored beside the trials, by name."""
