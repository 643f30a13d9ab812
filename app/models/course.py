"""Something of one track over time."""

from __future__ import annotations

from pydantic import Field

from app.models.base import Model


class TrackCourse(Model):
    """One curve, or one for each camera."""

    name: str
    word: str
    unit: str
    """Empty for a share."""
    help: str
    low: float
    """Value at the lower edge of its plot."""
    high: float
    """At its upper edge: a round number."""
    values: list[list[float | None]]
    """Each curve by buckets; null where the track is not there or the value is not known."""
    cameras: list[str] = Field(default_factory=list)
    """Whose the curves are; empty for one that is no camera's."""


class Courses(Model):
    """Of one track of the shown run, in the buckets that were asked for."""

    run: str
    track: int
    first: int
    stride: int
    """Steps a bucket: a value stands for the mean over them."""
    courses: list[TrackCourse]


class CourseKind(Model):
    """What can be plotted."""

    name: str
    word: str
    help: str
    needs_truth: bool


class CourseKinds(Model):
    """All of it, in the order of the list."""

    kinds: list[CourseKind]
