"""The address of a picture: of which sequence, camera and step; checked alike for all of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated

from fastapi import Query, Response
from jaxtyping import UInt8
from numpy import ndarray

from app.errors import ApiError
from app.state.snapshot import Snapshot
from app.web.dependencies import FOR_EVER
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Sequence

Missing = Callable[[str, str | None], ApiError]
"""The answer of a route where there is nothing: of a sentence, and what to do about it."""

Kept = Annotated[
    str | None,
    Query(description="As the step tells it: with it the answer may be kept for ever."),
]
"""The part of an address that names what a picture was made with, so that it may be cached."""


def missing(code: str) -> Missing:
    """The answers of one route."""
    return lambda message, hint: ApiError(404, code, message, hint=hint)


def checked(
    snapshot: Snapshot, sequence_key: str, camera: int, step: int, missing: Missing
) -> tuple[Sequence, FrameReader]:
    """The open sequence with its pictures, if it is the one that is asked for.

    Args:
        snapshot: What is open.
        sequence_key: Of the sequence that the page believes to be open.
        camera: Index.
        step: 0-based.
        missing: The answer of the route.

    Raises:
        ApiError: 404 if another sequence is open, or it has no such camera or step.
    """
    sequence, reader = snapshot.sequence, snapshot.reader
    if sequence is None or reader is None or snapshot.sequence_key != sequence_key:
        raise missing("That sequence is not open any more.", "Load the page again.")
    for what, index, count in (("camera", camera, len(sequence.views)),
                               ("step", step, sequence.frames)):  # fmt: skip
        if not 0 <= index < count:
            words = f"There is no {what} {index}: {sequence.name} has 0 … {count - 1}."
            raise missing(words, "Load the page again.")
    return sequence, reader


def picture_of(
    sequence: Sequence, reader: FrameReader, camera: int, step: int, missing: Missing
) -> UInt8[ndarray, "h w 3"]:
    """One camera's picture of one step, BGR.

    Raises:
        ApiError: 404 if there is none.
    """
    picture = reader.picture(camera, step)
    if picture is None:
        raise no_picture(sequence, camera, step, missing)
    return picture


def no_picture(sequence: Sequence, camera: int, step: int, missing: Missing) -> ApiError:
    """The answer where a camera's picture is missing."""
    return missing(
        f'Camera "{sequence.views[camera].camera.name}" has no picture of step {step}.',
        "The sequence has none for this camera, or its file ends before.",
    )


def png(content: bytes, kept: str | None) -> Response:
    """A picture to be laid over another one."""
    keep = "no-cache" if kept is None else FOR_EVER
    return Response(content, media_type="image/png", headers={"cache-control": keep})
