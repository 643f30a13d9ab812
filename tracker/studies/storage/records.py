"""The stored records of a study: trials that ended, their runs, and the status."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Annotated, Any, Literal, Required

from pydantic import AfterValidator, ConfigDict, Field
from typing_extensions import TypedDict

from tracker.parameters.values import with_current_keys

TrialState = Literal["complete", "pruned", "failed"]
"""The state of a trial that ended: with all runs, after its first runs, or because a run failed."""


@dataclass(frozen=True, slots=True)
class JobRow:
    """One run of a trial."""

    key: str
    """The key of the run's job."""
    recording: str
    """The name or folder of the recording."""
    seed: int
    """The seed of the run."""


@dataclass(frozen=True, slots=True)
class Trial:
    """A trial that ended."""

    number: int
    """The number of the trial; 0 is that of the defaults."""
    state: TrialState
    """How the trial ended."""
    values: Annotated[dict[str, Any], AfterValidator(with_current_keys)]
    """The varied parameters, by key."""
    objectives: tuple[float, ...] | None
    """The mean of each objective over recordings and seeds, or over the first runs if the trial was
    pruned; None if it failed."""
    spreads: tuple[float | None, ...]
    """The standard deviation of each objective over the seeds; None for a single seed."""
    figures: dict[str, float]
    """The means of all figures over recordings and seeds, by key."""
    vetoed: bool
    """Whether the held-out overlap is clearly less than that of the defaults (see
    :data:`~tracker.studies.definition.objectives.VETO`)."""
    words: str
    """The reason of a failure or pruning, or a remark on the trial."""
    seconds: float
    """The duration of all runs of the trial on the workers' clocks, seconds."""
    jobs: tuple[JobRow, ...]
    """The runs of the trial."""
    ended: float = 0.0
    """The time when the trial ended, seconds since 1970."""

    def to_json(self) -> dict[str, Any]:
        """Return all fields as plain values."""
        return asdict(self)


@dataclass(frozen=True, slots=True)
class Status:
    """The status of a study, which its process writes at intervals.

    A session is the time from one start of the study to its next end or interruption.
    """

    state: Literal["new", "running", "stopped", "done", "failed"] = "new"
    """The state of the study."""
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
    """The share of the workers' time in which they worked, 0 … 1, since the first run of the
    session ended; None before there are enough runs."""
    workers: list[dict[str, Any]] = field(default_factory=list)
    """The activity of each worker, as plain values."""
    all_runs: int = 0
    """The number of runs computed in all sessions together."""
    all_seconds: float = 0.0
    """The duration of all sessions together, seconds."""
    process: int = 0
    """The id of the process that runs the study."""
    written: float = 0.0
    """The time when the status was written, seconds since 1970."""


class StoredOutcome(TypedDict, total=False):
    """The JSON of an outcome, as returned by
    :meth:`tracker.studies.workers.jobs.Outcome.to_json`."""

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
