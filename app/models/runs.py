"""Runs since the server was started, and what sets the next one apart from the defaults."""

from __future__ import annotations

from typing import Any

from app.models.base import Model
from app.state.snapshot import RunPhase


class ChangedValue(Model):
    """A parameter or method that is not at its default."""

    key: str
    default: Any
    now: Any


class CurveInfo(Model):
    """What a parameter would change, as far as it is computed."""

    key: str
    measure: str
    """MOTA; where there is no truth the number of tracks."""
    values: list[Any]
    """Ascending, or the choices."""
    scores: list[float | None]
    """One a value; null where the run failed."""
    whole: bool
    """Whether there is nothing more to come."""
    share: float | None
    """Share of the variance of the measure that the parameter explains alone, among those whose
    curves are whole, as studies report it; null where there are not two of them."""


class Changes(Model):
    """What differs from the defaults, and what parameters would change."""

    changed: list[ChangedValue]
    curves: list[CurveInfo]
    """The curves of the parameters that somebody asked for."""


class PastRunInfo(Model):
    """One run, finished or not."""

    number: int
    """From 1 on."""
    key: str
    at: str
    """Time of day at which it began, as text."""
    sequence: str
    """The sequence's name at that time."""
    same_recording: bool
    """Whether it is of the recording that is open, so that its parameters can be used again."""
    single_view: str
    fusion_method: str
    state: RunPhase
    done: int
    total: int
    steps_per_second: float
    changes: int
    """How many parameters were not at their defaults."""


class PastRuns(Model):
    """The runs since the server was started, newest first."""

    runs: list[PastRunInfo]
