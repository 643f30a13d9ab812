"""What is written down of a study: trials that ended, their runs, and what it is doing."""

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
    recording: str
    seed: int


@dataclass(frozen=True, slots=True)
class Trial:
    """A trial that ended."""

    number: int
    state: TrialState
    values: dict[str, Any]
    """What was tried, by key."""
    objectives: tuple[float, ...] | None
    """Over recordings and seeds; None where it failed. Of a pruned one over its first runs."""
    spreads: tuple[float | None, ...]
    """Of each objective over the seeds."""
    figures: dict[str, float]
    """All other figures, over recordings and seeds."""
    vetoed: bool
    """Whether its people overlap too little with the cameras that were left out."""
    words: str
    """Why it failed or was given up, or what it is."""
    seconds: float
    """Of its runs on the workers' clocks."""
    jobs: tuple[JobRow, ...]
    ended: float = 0.0

    def to_json(self) -> dict[str, Any]:
        """As plain values."""
        return asdict(self)


@dataclass(frozen=True, slots=True)
class Status:
    """What a study is doing, as whoever runs it has said last."""

    state: Literal["new", "running", "stopped", "done", "failed"] = "new"
    words: str = ""
    """What it waits for, or why it ended."""
    done: int = 0
    """Trials that ended."""
    trials: int = 0
    runs: int = 0
    """Runs that ended in this start, those that were not needed again left out."""
    seconds: float = 0.0
    """Since this start."""
    seconds_left: float | None = None
    busy: float | None = None
    """Share of the workers' time, since all were there, in which they worked."""
    workers: list[dict[str, Any]] = field(default_factory=list)
    all_runs: int = 0
    """Runs that ended in all starts together."""
    all_seconds: float = 0.0
    """At work in all starts together."""
    process: int = 0
    written: float = 0.0
    """Seconds since 1970."""


class ToldOutcome(TypedDict, total=False):
    """A run that ended, as :meth:`tracker.studies.work.jobs.Outcome.to_json` writes it."""

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


TOLD: dict[str, Any] = {
    "spent": float,
    "code": str,
    "recordings": list[_Recording],
    "objectives": Annotated[list[_Objective], Field(min_length=1)],
    "importance": _Importance,
    "tuned": dict[str, Any],
}
"""What is written down beside the trials, by name."""
