"""Video files: whatever FFmpeg decodes, told by the first bytes of its container."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np

from tracker.io.read.pieces import Piece, VideoPiece
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import SourceFile
from tracker.sequences.pictures.containers import is_video, open_video
from tracker.sequences.pictures.video import VideoError, VideoIndex, index_video

NAME = "video"
KIND: Kind = "pictures"
SERIES = False


def recognise(file: SourceFile) -> Certainty:
    """The signature of a container."""
    is_picture = file.head.startswith(b"\xff\xd8\xff")  # also the beginning of a row of JPEGs
    is_it = is_video(file.head) and not is_picture
    return Certainty.SURE if is_it else Certainty.NO


def read(file: SourceFile) -> Iterator[Piece]:
    """Its frames, counted, its rate and the size of its pictures as they are shown."""
    try:
        index = index_video(file.path)
    except (VideoError, OSError) as error:
        raise file.error(
            f"({file.size:,} bytes) cannot be read as a video ({error}); expected MP4, AVI or "
            "another format that FFmpeg decodes; it may be cut short"
        ) from None
    capture = open_video(file.path)
    try:
        rate = float(capture.get(cv2.CAP_PROP_FPS))
        turned = round(capture.get(cv2.CAP_PROP_ORIENTATION_META)) % 360 != 0
    finally:
        capture.release()
    yield VideoPiece(file.path, index.frames, _rate(index, rate), index.size, turned)


def _rate(index: VideoIndex, header: float) -> float:
    """Frames a second from the time stamps; the header's where they differ by rounding only."""
    if index.times is None or len(index.times) < 2:
        return header if 0.0 < header < 1000.0 else 0.0
    span = float(index.times[-1] - index.times[0]) * 1e-6
    counted = (len(index.times) - 1) / span
    typical = 1e6 / float(np.median(np.diff(index.times)))
    near = 0.0 < header < 1000.0 and abs(header / counted - 1.0) < 0.02
    return header if near else counted if abs(counted / typical - 1.0) > 0.02 else typical
