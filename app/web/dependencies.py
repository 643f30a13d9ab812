"""What the routes share: the parts of the application that they work on, and their answers."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Annotated, Any

from fastapi import Depends, Query, Request

from app.errors import ApiError, Problem, sentence
from app.state.correcting import Correcting, Doubting
from app.state.edits import Edits
from app.state.history import History
from app.state.jobs import Jobs
from app.state.keeper import Marking
from app.state.presets import OwnPresets
from app.state.studies import StudyDesk
from app.state.teaching import Teaching
from app.state.workbench import Workbench
from app.web.timeline import BUCKETS, Window
from tracker.runs.pipeline import Cancelled

FOR_EVER = "private, max-age=31536000, immutable"
"""Cache header of pictures: their address names their content, which never changes."""

ERRORS: dict[int | str, dict[str, Any]] = {
    "4XX": {"model": Problem, "description": "What was expected, what was found, what to do."},
    "5XX": {"model": Problem, "description": "The server failed; what was open still is."},
}


@dataclass(frozen=True, slots=True)
class Owners:
    """Those who own what commands change."""

    workbench: Workbench
    edits: Edits
    presets: OwnPresets
    history: History
    teaching: Teaching
    correcting: Correcting
    doubting: Doubting
    marking: Marking
    studies: StudyDesk


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


OPENING_SECONDS = 1.0
"""How long a request to open waits, so that what fails at once is told in the answer."""


async def begun(opening: Future[None]) -> None:
    """Done when something is open, or has taken so long that it goes on in the background.

    Raises:
        Exception: What the opening failed with, as far as it did in that time.
    """
    future = asyncio.wrap_future(opening)
    try:
        await asyncio.wait_for(asyncio.shield(future), OPENING_SECONDS)
    except TimeoutError:
        future.add_done_callback(lambda done: done.cancelled() or done.exception())


@contextmanager
def told_in_the_answer(title: str, *, field: str, hint: str) -> Iterator[None]:
    """Within it a failure to open is the client's to mend.

    Args:
        title: Of what is opened.
        field: Of the request that names it.
        hint: What holds still, and what can be done.

    Raises:
        ApiError: 409 where another opening took over, 422 where it cannot be opened.
    """
    try:
        yield
    except Cancelled as error:
        raise ApiError(409, "superseded", f"{title}: {error}.") from None
    except (ValueError, OSError) as error:
        raise ApiError(422, "cannot_open", sentence(error), field=field, hint=hint) from None
