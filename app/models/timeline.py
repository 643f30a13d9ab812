"""A run over time."""

from __future__ import annotations

from typing import Literal

from app.models.base import Model

Span = tuple[int, int, Literal["seen", "coasting", "long miss"]]
"""First step, last step, and whether any camera saw the target; a long miss is coasting too."""

LaneEvent = tuple[int, int, Literal["birth", "death", "long miss", "cut", "joined", "removed"]]
"""Step, track and what happened to it; the last three by smoothing."""


class TrackLife(Model):
    """A track's life."""

    id: int
    name: str | None = None
    """What somebody said, or whose colours it has, among people with templates."""
    first: int
    last: int
    """Of its whole life."""
    seen: float
    """Share of its whole life in which a camera saw it."""
    cameras: list[float]
    """The same share for each camera by itself."""
    spans: list[Span]
    """Within the steps asked for; ones shorter than ``stride`` are joined with their neighbours."""


class Counts(Model):
    """Whole numbers over time: of each bucket the lowest, the highest and the mean."""

    low: list[int]
    high: list[int]
    mean: list[float]


class Numbers(Model):
    """Numbers over time: of each bucket the lowest, the highest and the mean."""

    low: list[float]
    high: list[float]
    mean: list[float]


class PinnedLife(TrackLife):
    """A track of the pinned run."""

    like: int | None
    """The track of the shown run that it is most often paired with."""


class PinnedTimeline(Model):
    """The pinned run, in the same buckets."""

    run: str
    count: Counts
    tracks: list[PinnedLife]


class Decided(Model):
    """What smoothing made otherwise than the filter, and why."""

    step: int
    track: int
    kind: Literal["cut", "joined", "removed"]
    words: str


class Timeline(Model):
    """The shown run over time, as far as it is computed, summed up in buckets of steps."""

    run: str
    done: int
    frames: int
    first: int
    """The first step of the first bucket."""
    stride: int
    """Steps a bucket: 1 where each step has its own value."""
    cardinality: Numbers
    """Expected number of people."""
    deviation: Numbers
    """Its standard deviation."""
    count: Counts
    """Targets reported."""
    truth: Counts | None
    """People really there, over all steps asked for."""
    tracks: list[TrackLife]
    """Those that live in the steps asked for, by id."""
    pinned: PinnedTimeline | None
    """Where a run is pinned that is not the shown one."""
    events: list[LaneEvent]
    """Of all steps, also of those not asked for, in their order."""
    decisions: list[Decided]
    """What smoothing changed, by its step; empty for the filter alone."""
    left_out: int
    """How many more live there: the shorter ones, where they are very many."""
