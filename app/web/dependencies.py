"""What the routes share: the parts of the application that they work on, and their answers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from fastapi import Depends, Query, Request

from app.errors import ApiError, Problem
from app.state.workbench import Workbench
from app.state.workers.jobs import Jobs
from app.web.commands.command import Owners
from app.web.views.timeline import BUCKETS, Window

FOR_EVER = "private, max-age=31536000, immutable"
"""Cache header of pictures: their address names their content, which never changes."""

ERRORS: dict[int | str, dict[str, Any]] = {
    "4XX": {"model": Problem, "description": "What was expected, what was found, what to do."},
    "5XX": {"model": Problem, "description": "The server failed; what was open still is."},
}


def _workbench(request: Request) -> Workbench:
    workbench: Workbench = request.app.state.workbench
    return workbench


def _jobs(request: Request) -> Jobs:
    jobs: Jobs = request.app.state.jobs
    return jobs


def _owners(request: Request) -> Owners:
    owners: Owners = request.app.state.owners
    return owners


@dataclass(frozen=True, slots=True)
class Shown:
    """The range of steps that a plot shows, and into how many buckets it is summed up."""

    first: int
    last: int | None
    buckets: int

    def window(self, frames: int) -> Window:
        """As buckets of a sequence; bounds beyond it are its ends."""
        return Window.of(frames, self.first, self.last, self.buckets)


def _shown(
    first: Annotated[int, Query(ge=0, description="First step.")] = 0,
    last: Annotated[int | None, Query(ge=0, description="Last step, else the end.")] = None,
    buckets: Annotated[int, Query(ge=1, le=1 << 14, description="Most values a curve.")] = BUCKETS,
) -> Shown:
    return Shown(first, last, buckets)


Part = Annotated[Shown, Depends(_shown)]
Bench = Annotated[Workbench, Depends(_workbench)]
Owned = Annotated[Owners, Depends(_owners)]
Work = Annotated[Jobs, Depends(_jobs)]


def nothing_open() -> ApiError:
    """The answer to whoever asks for what only an open sequence has."""
    return ApiError(
        409,
        "nothing_open",
        "No sequence is open.",
        hint="Open one first.",
    )


def not_finished(what: str, done: int, steps: int) -> ApiError:
    """The answer to whoever asks of a run under way for what only a finished one has."""
    there = f"{done} of {steps} steps are there" if done < steps else "smoothing is still to come"
    return ApiError(
        409,
        "not_finished",
        f"Only a finished run {what}: {there}.",
        hint="Wait for its end, or go on with it.",
    )


def file_name(name: str, ending: str) -> str:
    """Of a download: plain letters only."""
    plain = "".join(c if c.isascii() and (c.isalnum() or c in "-_.") else "-" for c in name)
    return f"{plain}-{ending}"
