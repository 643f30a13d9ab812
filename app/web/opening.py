"""How a route opens something: what fails at once is in its answer, what takes longer goes on."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import contextmanager

from app.errors import ApiError, sentence
from tracker.runs.pipeline import Cancelled

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
