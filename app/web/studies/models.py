"""What the routes of studies take and answer, as types."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from app.models import Model


class StudyInfo(Model):
    """A study in a line."""

    name: str
    state: Literal["new", "running", "stopped", "done", "failed"]
    words: str
    """What it waits for, or why it ended."""
    done: int
    """Trials that ended."""
    trials: int | None
    """All there are to be; null where the time alone ends it."""
    touched: float
    """When it was at work last, seconds since 1970."""
    seconds_left: float | None
    objective: str
    """Name of the leading figure."""
    best: float | None
    """Its best value."""
    default: float | None


class StudyList(Model):
    """All studies, the one that was at work last first."""

    folder: str
    studies: list[StudyInfo]


class RangeInfo(Model):
    """A parameter, or the choice of a method, with the range that is tried."""

    key: str
    label: str
    symbol: str
    unit: str
    help: str
    kind: Literal["float", "int", "bool", "choice"]
    minimum: float | None
    """Of its definition."""
    maximum: float | None
    low: float | None
    high: float | None
    log: bool
    choices: list[Any]
    """Of what is no range."""
    default: Any
    now: Any
    """Today's value."""


class ObjectiveInfo(Model):
    """A figure that trials can be judged by."""

    key: str
    name: str
    help: str
    higher: bool
    """Whether more of it is better."""
    unit: str
    digits: int
    of: Literal["truth", "run", "agreement"]
    """What it needs: a truth, nothing but the run, or other looks at the recording."""


class StudyDraft(Model):
    """A study as it could be defined from what is open."""

    name: str
    """One that is free."""
    recordings: list[str]
    has_truth: bool
    parameters: list[RangeInfo]
    objectives: list[str]
    """Those that it would have."""
    choices: list[ObjectiveInfo]
    """Those that it could have."""
    workers: int
    """Cores of the machine."""
    words: str
    """What is not in the study though it is on the screen; empty for nothing."""


class RangeWish(Model):
    """How far a parameter is varied; what is null follows from its definition."""

    low: float | None = None
    high: float | None = None
    log: bool | None = None
    steps: int | None = None
    """Of a number on a grid."""
    choices: list[Any] | None = None


class StudyWish(Model):
    """What is to be studied; what is not varied is held at today's values."""

    name: str
    recordings: list[str] | None = None
    """Rooms and folders; null for the one that is open."""
    parameters: dict[str, RangeWish]
    trials: int = Field(default=60, ge=1)
    minutes: float | None = Field(default=None, gt=0)
    """No trial begins after so long."""
    seeds: int = Field(default=1, ge=1, le=1000)
    search: str = "auto"
    objectives: list[str] = Field(default_factory=list)
    """The leading one first; none: they follow the recordings."""
    prune: bool = True


class StartWish(Model):
    """Where a study runs."""

    workers: int | None = Field(default=None, ge=1, le=1024)
    """Processes on this machine."""
    scheduler: str | None = None
    """Address of a Dask scheduler. With neither it runs where it ran last, and at first with one
    process a core of this machine."""


class CostWish(StudyWish, StartWish):
    """A study, and where it is to run."""


class StudyCost(Model):
    """What a study would take."""

    runs: int
    seconds: float | None
    """Null where nothing is known of how long a run takes, or of how many there are at a time."""
    bytes: int
    words: str
    error: str | None
    """Why it would be refused."""


class SchedulerWish(Model):
    """A cluster that is asked after."""

    address: str


class SchedulerInfo(Model):
    """What answers at a scheduler's address."""

    address: str
    workers: int
    threads: int
    machines: list[str]
    error: str | None
    """Why it cannot be used."""


class WorkerInfo(Model):
    """A worker of a study that runs."""

    name: str
    machine: str
    words: str
    """What it waits for; empty while it works on a run."""
    trial: int | None
    recording: str | None
    seed: int | None
    since: float
    """Seconds since 1970."""


class StudyStatus(Model):
    """What a study does now."""

    runs: int
    """That ended, however often it was started."""
    seconds: float
    """In which it was at work."""
    seconds_left: float | None
    busy: float | None
    """Share of the workers' time in which they worked."""
    workers: list[WorkerInfo]


class ImportanceInfo(Model):
    """How much of the leading figure's variance a parameter explains by itself."""

    key: str
    share: float
    spread: float
    """Standard deviation, over trials drawn with replacement."""


class Study(Model):
    """Everything of a study but its trials."""

    info: StudyInfo
    definition: dict[str, Any]
    """As its file has it."""
    toml: str
    objectives: list[ObjectiveInfo]
    beside: list[ObjectiveInfo]
    """Other figures worth a column, by their keys in those of the trials."""
    varied: list[RangeInfo]
    status: StudyStatus
    best: int | None
    """Number of the best trial; 0 where nothing is better than the defaults."""
    front: list[int]
    """Trials that no other beats in all objectives."""
    importance: list[ImportanceInfo]
    """Empty while there are too few trials."""
    importance_trials: int
    sentences: list[str]


class TrialInfo(Model):
    """A trial that ended."""

    number: int
    state: Literal["complete", "pruned", "failed"]
    values: dict[str, Any]
    objectives: list[float] | None
    """Over recordings and seeds; null where it failed."""
    spreads: list[float | None]
    """Of each over the seeds."""
    figures: dict[str, float]
    vetoed: bool
    """Whether people overlap too little with the cameras that were left out."""
    words: str
    seconds: float
    """Of its runs."""
    ended: float
    """Seconds since 1970."""


class TrialList(Model):
    """Trials that ended after a moment."""

    trials: list[TrialInfo]
    last: float
    """To be given as `after` the next time."""


class TrialRun(Model):
    """One run of a trial."""

    key: str
    """Hash of recording, values, seed and code."""
    recording: str
    seed: int
    figures: dict[str, float | None]
    seconds: float
    worker: str
    machine: str
    tracks: str
    """Hash of its tracks."""


class TrialDetail(Model):
    """A trial with its runs and what repeats them."""

    trial: TrialInfo
    runs: list[TrialRun]
    commands: list[str]


class TuneWish(StartWish):
    """The open recording is to be tuned, from today's values."""

    minutes: float = Field(default=5.0, gt=0, le=10_000)
    without_truth: bool = False
    """Whether truth is not looked at though it is there."""


class TunedRow(Model):
    """A parameter that the proposal changes."""

    key: str
    symbol: str
    unit: str
    default: Any
    before: Any
    after: Any
    brought: float | None
    """Of the leading figure, against the proposal without it; null where the time was over."""


class TunedFigure(Model):
    """A figure of the proposal, on the seeds that no trial had."""

    key: str
    name: str
    default: float | None
    before: float | None
    after: float | None


class Tuned(Model):
    """What a study proposes at its end."""

    done: bool
    """Whether the best were measured again; all else is empty before."""
    better: bool
    """Whether anything better was found than where somebody was."""
    words: str
    trial: int | None
    """Of the same values; null where changes that bring nothing were put back."""
    seeds: list[int]
    rows: list[TunedRow]
    figures: list[TunedFigure]
