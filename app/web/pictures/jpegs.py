"""Pictures for the page: decoded and encoded in threads, the last ones kept."""

from __future__ import annotations

import asyncio
from collections import OrderedDict
from concurrent.futures import ThreadPoolExecutor

import cv2

from app.state.workbench import Workbench
from app.web.pictures.address import checked, missing, no_picture
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Sequence

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
            job.add_done_callback(lambda done: self._keep(key, done))
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

    def _keep(self, key: Key, job: asyncio.Future[bytes | None]) -> None:
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
