"""Pictures on the wire: their addresses, which are checked alike, frames, and the 3D view."""

from __future__ import annotations

import asyncio
from collections import OrderedDict
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Annotated

import cv2
from fastapi import APIRouter, Query, Request, Response
from jaxtyping import UInt8
from numpy import ndarray

from app.errors import ApiError, sentence
from app.state.snapshot import Snapshot
from app.state.workbench import Workbench
from app.web.dependencies import ERRORS, FOR_EVER, a_file
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


KEPT_BYTES = 96 << 20
QUALITY = 88
THREADS = 4
"""One request mostly waits for one camera's decoder; four cameras are asked at once."""

REACH = 250
"""Steps before and after one that has no picture, among which one is sought that stands for it."""

_missing = missing("no_picture")

Key = tuple[str, int, int, int]


class Pictures:
    """JPEGs of the open sequence. Lives on the event loop; only the work is done in threads."""

    def __init__(self, workbench: Workbench) -> None:
        self._workbench = workbench
        self._pool = ThreadPoolExecutor(THREADS, "pictures")
        self._kept: OrderedDict[Key, bytes] = OrderedDict()
        self._bytes = 0
        self._under_way: dict[Key, asyncio.Future[bytes | None]] = {}

    async def get(self, sequence_key: str, camera: int, step: int, width: int | None) -> bytes:
        """One picture as JPEG.

        Args:
            sequence_key: Of the sequence that the page believes to be open.
            camera: Index.
            step: 0-based.
            width: Pixels, where the page wants it smaller than it is.

        Raises:
            ApiError: 404 where there is none.
        """
        sequence, reader = self._checked(sequence_key, camera, step)
        key = (sequence_key, camera, step, width or 0)
        if key in self._kept:
            self._kept.move_to_end(key)
            return self._kept[key]
        if key not in self._under_way:
            loop = asyncio.get_running_loop()
            job = loop.run_in_executor(self._pool, _encode, reader, camera, step, width)
            self._under_way[key] = job
            job.add_done_callback(lambda done: self._cache(key, done))
        # a page that gives up must not cancel what another one waits for
        jpeg = await asyncio.shield(self._under_way[key])
        if jpeg is None:
            self._checked(sequence_key, camera, step)  # another one may be open by now
            raise no_picture(sequence, camera, step, _missing)
        return jpeg

    async def nearest(self, sequence_key: str, camera: int, step: int) -> int:
        """The step nearest to one of which the camera has a picture; the earlier of two.

        Raises:
            ApiError: 404 where there is none within :data:`REACH` steps.
        """
        sequence, reader = self._checked(sequence_key, camera, step)
        loop = asyncio.get_running_loop()
        found = await loop.run_in_executor(self._pool, _nearest, reader, camera, step)
        if found is None:
            raise no_picture(sequence, camera, step, _missing)
        return found

    def _checked(self, sequence_key: str, camera: int, step: int) -> tuple[Sequence, FrameReader]:
        return checked(self._workbench.snapshot(), sequence_key, camera, step, _missing)

    def _cache(self, key: Key, job: asyncio.Future[bytes | None]) -> None:
        self._under_way.pop(key, None)
        if job.cancelled() or job.exception() is not None:
            return
        jpeg = job.result()
        if jpeg is None:
            return
        self._kept[key] = jpeg
        self._bytes += len(jpeg)
        while self._bytes > KEPT_BYTES:
            _, oldest = self._kept.popitem(last=False)
            self._bytes -= len(oldest)

    def close(self) -> None:
        """End the threads; what is being decoded is finished first."""
        self._pool.shutdown(wait=False, cancel_futures=True)


def _nearest(reader: FrameReader, camera: int, step: int) -> int | None:
    for away in range(REACH + 1):
        for other in (step - away, step + away):
            if reader.picture(camera, other) is not None:
                return other
    return None


def _encode(reader: FrameReader, camera: int, step: int, width: int | None) -> bytes | None:
    picture = reader.picture(camera, step)
    if picture is None:
        return None
    if width is not None and width < picture.shape[1]:
        height = max(1, round(picture.shape[0] * width / picture.shape[1]))
        picture = cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA)
    done, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    return bytes(data) if done else None


router = APIRouter(prefix="/api/view", responses=ERRORS)


@router.get("/picture.png", **a_file("image/png", "The picture."))
def picture(
    request: Request,
    width: Annotated[int, Query(ge=16, le=8192, description="Pixels.")] = 1280,
    height: Annotated[int, Query(ge=16, le=8192, description="Pixels.")] = 800,
) -> Response:
    """What the browser that came last shows in 3D, drawn once more by it."""
    room = request.app.state.room
    try:
        if room.scene is None:
            raise LookupError("the 3D view is not there")
        drawn = room.scene.picture(width, height)
    except LookupError as error:
        raise ApiError(
            409,
            "no_view",
            f"There is no picture of the 3D view: {sentence(error)}.",
            hint="Open the page in a browser and try again.",
        ) from None
    _, data = cv2.imencode(".png", drawn[..., ::-1])
    return Response(data.tobytes(), media_type="image/png", headers={"cache-control": "no-store"})
