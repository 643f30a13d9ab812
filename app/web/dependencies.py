"""What the routes share: the parts of the application that they work on, and their answers."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from fastapi import Depends, Query, Request, Response

from app.errors import ApiError, Problem, sentence
from app.state.correcting import Correcting, Doubting
from app.state.edits import Edits
from app.state.history import History
from app.state.jobs import Jobs
from app.state.keeper import Marking
from app.state.presets import OwnPresets
from app.state.snapshot import Snapshot
from app.state.studies import StudyDesk
from app.state.teaching import Teaching
from app.state.workbench import Workbench
from app.web.access.tokens import Keys
from app.web.timeline import BUCKETS, Window
from tracker.library import KEEP
from tracker.library.records import Result
from tracker.runs.pipeline import Cancelled
from tracker.sequences.sequence import Sequence

FOR_EVER = "private, max-age=31536000, immutable"
"""Cache header of pictures: their address names their content, which never changes."""

ERRORS: dict[int | str, dict[str, Any]] = {
    "4XX": {"model": Problem, "description": "What was expected, what was found, what to do."},
    "5XX": {"model": Problem, "description": "The server failed; what was open still is."},
}


@dataclass(frozen=True, slots=True)
class Settings:
    """What a server is started with."""

    host: str = "127.0.0.1"
    keys: Keys | None = None
    """What lets in; None: whoever reaches it."""
    sequence: str | None = None
    """Opened at once, in the background."""
    data: Path | None = None
    """Its folders are sequences that can be chosen."""
    detector: Path | None = None
    """A detection network (ONNX) that may be run on the pictures of each."""
    seed: int = 0
    with_viser: bool = True
    keep_on_disk: bool = False
    """Whether what was compiled and what the cameras found is kept for the next start."""
    library: Path | None = None
    """The file that keeps runs; None: they are not kept."""
    keep: int = KEEP
    """How many untouched runs stay in it."""
    memory: int | None = None
    """Bytes that may be kept for speed; None for half of the machine, or less."""
    disk: int | None = None
    """Bytes on disk that may be kept of earlier runs' stages; None for the usual limit."""
    run: int | Result | None = None
    """A run of it that is shown at once, instead of a sequence; or one that lies elsewhere, which
    is only looked at: nothing is computed, and nothing can be changed."""
    say: Callable[[str], None] = lambda words: None
    """Told what somebody in front of the terminal should know."""
    ended: tuple[int, int] | None = None
    """Process and signal of the start before this one, where it crashed."""


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


def of_app(name: str) -> Any:
    """What gives a route a part of the application, by the name that it has there."""

    async def part(request: Request) -> Any:  # else it would take a thread for each request
        return getattr(request.app.state, name)

    return Depends(part)


@dataclass(frozen=True)
class Shown:
    """The range of steps that a plot shows, and into how many buckets it is summed up."""

    first: Annotated[int, Query(ge=0, description="First step.")] = 0
    last: Annotated[int | None, Query(ge=0, description="Last step, else the end.")] = None
    buckets: Annotated[int, Query(ge=1, le=1 << 14, description="Most values a curve.")] = BUCKETS

    def window(self, frames: int) -> Window:
        """As buckets of a sequence; bounds beyond it are its ends."""
        return Window.of(frames, self.first, self.last, self.buckets)


Part = Annotated[Shown, Depends()]
Bench = Annotated[Workbench, of_app("workbench")]
Owned = Annotated[Owners, of_app("owners")]
Work = Annotated[Jobs, of_app("jobs")]
Configured = Annotated[Settings, of_app("settings")]


def opened(workbench: Workbench) -> tuple[Snapshot, Sequence]:
    """The state, with the sequence that is open.

    Raises:
        ApiError: If none is.
    """
    snapshot = workbench.snapshot()
    if snapshot.sequence is None:
        raise ApiError(409, "nothing_open", "No sequence is open.", hint="Open one first.")
    return snapshot, snapshot.sequence


def a_file(media: str, words: str) -> dict[str, Any]:
    """What the description of a route says that answers with a file."""
    content = {"content": {media: {}}, "description": words}
    return {"response_class": Response, "responses": {200: content}}


def download(data: str | bytes, name: str, media: str, **headers: str) -> Response:
    """An answer that a browser saves as a file of this name; headers have ``_`` for ``-``."""
    own = {key.replace("_", "-"): value for key, value in headers.items()}
    attached = {
        "content-disposition": f'attachment; filename="{name}"',
        "cache-control": "no-store",
    }
    return Response(data, media_type=media, headers=attached | own)


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
