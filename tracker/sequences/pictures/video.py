"""One video file, frame-exact: frame k is the k-th picture that decoding from the start gives.

A container answers "go to frame k" with an estimate: frame rate times time. With a
varying frame rate, a stream that starts late or a missing index the estimate is wrong
by a few frames, or by seconds. So the time stamps of all frames are read first, without
decoding, which is fast. Where a jump ends, the time stamp of the decoded picture identifies the
frame. Files whose time stamps do not identify frames (some AVI and MPEG files) are always decoded
from their start.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Int, UInt8
from numpy import ndarray

from tracker.files.atomic import size_of
from tracker.sequences.fields import LARGEST_COUNT
from tracker.sequences.pictures.containers import MOST_PIXELS, VideoError, open_video

__all__ = ["VideoDecoder", "VideoError", "VideoIndex", "index_video", "read_image"]

DECODED_TO_VERIFY = 24
"""The number of frames that are decoded from the start to check the time stamps; more than any
codec reorders."""

RUN_UP = 16
"""The number of frames before the wanted one at which a jump aims, from which all are decoded.
Right after a jump frames can be out of order by as many as a codec may reorder, in H.264 at most
16."""


LARGEST_IMAGE = 2**28
"""Largest size of an image file, more than cameras' pictures have with any compression, bytes."""


@dataclass(frozen=True, slots=True, eq=False)
class VideoIndex:
    """The index of the F frames of a video file."""

    path: Path
    size: tuple[int, int]
    """Width and height in pixels."""
    frames: int
    """The number F of frames, by counting, since the header of a truncated file is wrong."""
    times: Int[ndarray, " F"] | None
    """Time stamps, microseconds, ascending; None if they do not identify the frames."""
    keys: Int[ndarray, " K"]
    """The key frames, at which decoding can start."""
    fps: float | None = None
    """The frame rate by the time stamps or else by the header, 1/s; None if neither has one."""


def index_video(path: Path) -> VideoIndex:
    """Return the index of a video file, which is cached until the file changes.

    Raises:
        VideoError: If no frame of it can be decoded.
    """
    status = path.stat()
    return _index_video(path, status.st_size, status.st_mtime_ns)


@lru_cache(maxsize=64)
def _index_video(path: Path, bytes_: int, changed: int) -> VideoIndex:
    """Return the index of a video from its packets and its first pictures."""
    stamps, is_key = _scan(path)
    capture = open_video(path)
    try:
        decoded = list(_first_times(capture, DECODED_TO_VERIFY))
        if not decoded:
            raise VideoError("no picture in it can be decoded")
        size = (
            int(capture.get(_SIDES[0])),
            int(capture.get(_SIDES[1])),
        )
        claimed = float(capture.get(cv2.CAP_PROP_FPS))
        frames = len(stamps)
        if frames < len(decoded):  # no packets to count: count pictures
            frames = len(decoded)
            while capture.grab():
                frames += 1
    finally:
        capture.release()
    order = np.argsort(stamps, kind="stable")
    times = stamps[order]
    exact = (
        len(times) == frames
        and bool((np.diff(times) > 0).all())
        and _in_order(times, np.array(decoded, dtype=np.int64))
    )
    return VideoIndex(
        path=path,
        size=size,
        frames=frames,
        times=times if exact else None,
        keys=np.flatnonzero(is_key[order]) if exact else np.zeros(1, dtype=np.int64),
        fps=_rate(times if exact else times[:0], claimed),
    )


def _rate(times: Int[ndarray, " F"], claimed: float) -> float | None:
    """Return the frame rate by the time stamps, 1/s, or else by the header.

    Args:
        times: Time stamps of the frames, microseconds.
        claimed: The rate in the header, 1/s.

    Returns:
        The rate; None if there are fewer than two time stamps and the header has no valid rate.
    """
    if len(times) > 1:
        measured = 1e6 * (len(times) - 1) / float(times[-1] - times[0])
        # time stamps are rounded, so the header's rate is more precise where both agree
        agree = 0.0 < claimed < 1000.0 and abs(measured / claimed - 1.0) < 2e-3
        return claimed if agree else round(measured, 3)
    return claimed if 0.0 < claimed < 1000.0 else None


_SIDES = (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT)


def _scan(path: Path) -> tuple[Int[ndarray, " F"], ndarray]:
    """Read time stamp, microseconds, and key flag of every packet, in the file's order."""
    capture = open_video(path, packets=True)
    stamps: list[int] = []
    keys: list[bool] = []
    try:
        width, height = (int(capture.get(side)) for side in _SIDES)
        if width * height > MOST_PIXELS:
            raise VideoError(
                f"expected pictures of at most {MOST_PIXELS:,} pixels, found {width}×{height}; "
                "make them smaller"
            )
        while capture.grab():
            if len(stamps) >= LARGEST_COUNT:
                raise VideoError(f"expected at most {LARGEST_COUNT:,} frames, found more; cut it")
            stamps.append(_time(capture))
            keys.append(capture.get(cv2.CAP_PROP_LRF_HAS_KEY_FRAME) > 0.0)
    finally:
        capture.release()
    return np.array(stamps, dtype=np.int64), np.array(keys, dtype=bool)


def _first_times(capture: cv2.VideoCapture, count: int) -> Iterator[int]:
    """Yield the time stamps of the next pictures that can be decoded, microseconds."""
    for _ in range(count):
        if capture.grab():
            yield _time(capture)


def _time(capture: cv2.VideoCapture) -> int:
    """Return the time stamp of the packet or picture that was read last, microseconds."""
    return round(capture.get(cv2.CAP_PROP_POS_MSEC) * 1000.0)


def _in_order(times: Int[ndarray, " F"], decoded: Int[ndarray, " D"]) -> bool:
    """Whether the decoded pictures are frame 0 and later frames in ascending order.

    Args:
        times: Time stamps of all F frames, ascending, microseconds.
        decoded: Time stamps of D pictures in the order of decoding.
    """
    places = np.searchsorted(times, decoded)
    known = bool((times[np.minimum(places, len(times) - 1)] == decoded).all())
    return known and int(places[0]) == 0 and bool((np.diff(places) > 0).all())


class VideoDecoder:
    """A decoder of one file. It gives frames in any order, fastest in ascending order.

    It is not thread-safe.
    """

    def __init__(self, index: VideoIndex) -> None:
        self._index = index
        self._times = index.times
        self._capture: cv2.VideoCapture | None = None
        self._at = -1
        """Index of the frame that was read last; -1 before the first."""
        self._broken = False
        """Whether the frame that was read last could not be decoded."""

    def __enter__(self) -> VideoDecoder:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def position(self) -> int:
        """Index of the frame that was read last; -1 before the first."""
        return self._at

    def read(self, frame: int) -> UInt8[ndarray, "h w 3"] | None:
        """Decode one frame.

        Returns:
            The picture, BGR, a new array; None if there is no such frame, or it cannot be decoded.
        """
        if not 0 <= frame < self._index.frames:
            return None
        try:
            if self._capture is None or frame < self._at or self._jump_saves_decoding(frame):
                self._jump(frame)
            self._advance_to(frame)
            if self._at != frame or self._broken or self._capture is None:
                return None
            good, picture = self._capture.retrieve()
        except (cv2.error, VideoError, OSError):  # a damaged frame, or the file was replaced
            self.close()
            return None
        return np.asarray(picture, dtype=np.uint8) if good else None

    def close(self) -> None:
        """Release the file. A later :meth:`read` opens it again."""
        if self._capture is not None:
            self._capture.release()
            self._capture = None

    def _jump_saves_decoding(self, frame: int) -> bool:
        """Whether a jump to a frame would decode less than reading on from the present one.

        A jump decodes from the last key frame at least :data:`RUN_UP` frames before its target.
        """
        if self._times is None or frame - RUN_UP <= self._at:
            return False
        keys = self._index.keys
        last_key = int(keys[np.searchsorted(keys, frame - RUN_UP, side="right") - 1])
        return last_key > self._at + 1

    def _jump(self, frame: int) -> None:
        """Move to ``frame`` or to a frame before it, as near as the file allows."""
        if self._capture is None:
            self._open()
            if frame <= RUN_UP:  # the start of the file is near enough
                return
        back = 0
        while self._times is not None and frame - back > 0:
            assert self._capture is not None
            self._capture.set(cv2.CAP_PROP_POS_MSEC, self._times[frame - back] / 1000.0)
            if self._capture.grab():
                landed = self._frame_of(_time(self._capture))
                if landed is not None and landed <= frame:
                    self._at, self._broken = landed, False
                    return
            back = max(2 * RUN_UP, 4 * back)
        self._open()

    def _open(self) -> None:
        """Open the file, or open it again, at its start."""
        self.close()
        self._capture = open_video(self._index.path)
        self._at, self._broken = -1, False

    def _advance_to(self, frame: int) -> None:
        """Read frames up to ``frame``, or to the first later one that can be decoded."""
        assert self._capture is not None
        while self._at < frame:
            if self._times is None:  # each call of `grab` is one frame, decodable or not
                self._broken = not self._capture.grab()
                self._at += 1
                continue
            # at a damaged frame `grab` fails once, and the next call gives the next frame; at the
            # end of the file every call fails
            good = any(self._capture.grab() for _ in range(self._index.frames - self._at))
            landed = self._frame_of(_time(self._capture)) if good else self._index.frames
            if landed is None or landed <= self._at:
                self._ignore_times()
            else:
                self._at = landed

    def _frame_of(self, time: int) -> int | None:
        """Return the index of the frame with this time stamp, microseconds; None if none has it."""
        assert self._times is not None
        place = int(np.searchsorted(self._times, time))
        return place if place < len(self._times) and self._times[place] == time else None

    def _ignore_times(self) -> None:
        """Count frames from the start of the file from now on, since its time stamps are
        inconsistent."""
        self._times = None
        self._open()


def read_image(path: Path) -> UInt8[ndarray, "h w 3"] | None:
    """Read a picture file, BGR; None if it is missing, too large or not a picture."""
    with contextlib.suppress(OSError, cv2.error):
        if size_of(path) > LARGEST_IMAGE:
            return None
        data = np.frombuffer(path.read_bytes(), dtype=np.uint8)
        picture = cv2.imdecode(data, cv2.IMREAD_COLOR) if len(data) else None
        return None if picture is None else np.asarray(picture, dtype=np.uint8)
    return None


def why_no_picture(path: Path) -> str:
    """Return the reason why :func:`read_image` returned None; a message puts the name before it."""
    try:
        found = f"{size_of(path):,} bytes"
    except OSError as error:
        found = error.strerror or "nothing"
    return (
        f"cannot be read as a picture ({found}); expected a whole JPEG, PNG, BMP, TIFF or WebP "
        f"file of at most {LARGEST_IMAGE >> 20} MB"
    )
