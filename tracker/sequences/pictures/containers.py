"""The files that are opened as videos: known containers, recognised by their first bytes.

FFmpeg also accepts lists of other files as videos, whatever their suffix (HLS, concat,
SDP, numbered pictures): through these an untrusted recording could read any file of this
machine, or wait for a network forever. So the first bytes are checked before FFmpeg opens a file,
and FFmpeg itself is restricted to these containers and to local files.

Source: FFmpeg, "Format Options" (``format_whitelist``, ``protocol_whitelist``).
"""

from __future__ import annotations

import os
import stat
from pathlib import Path

# broken frames are reported by the reader, so FFmpeg's own messages are switched off
os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")

import cv2

DEMUXERS = (
    "avi", "mov", "mp4", "matroska", "webm", "mpegts", "mpeg", "mpegvideo", "flv", "asf", "ogg",
    "h264", "hevc", "ivf", "mjpeg", "mxf", "yuv4mpegpipe",
)  # fmt: skip
"""FFmpeg's names of the containers that may be opened."""

_OPTIONS = "OPENCV_FFMPEG_CAPTURE_OPTIONS"
_OWN = os.environ.get(_OPTIONS, "")
os.environ[_OPTIONS] = "|".join(
    [*([_OWN] if _OWN else []), "protocol_whitelist;file", f"format_whitelist;{','.join(DEMUXERS)}"]
)

cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_ERROR)

MOST_PIXELS = 2**26
"""Most pixels of a picture (67 million), each of which takes three bytes of memory."""

PATIENCE_MS = 10_000
"""Longest time of FFmpeg for opening a file and for each read, milliseconds."""

HEAD = 3 * 192 + 4
"""The number of bytes by which a container is recognised."""

_STARTS = (
    b"\x1aE\xdf\xa3",  # Matroska, WebM
    b"\x00\x00\x01\xba", b"\x00\x00\x01\xb3",  # MPEG
    b"\x00\x00\x00\x01", b"\x00\x00\x01",  # H.264 and H.265 without a container
    b"FLV\x01", b"OggS", b"\x30\x26\xb2\x75\x8e\x66\xcf\x11",  # the last: ASF, WMV
    b"DKIF", b"YUV4MPEG2 ", b"\xff\xd8\xff", b"\x06\x0e\x2b\x34\x02\x05\x01\x01",  # the last: MXF
)  # fmt: skip
_BOXES = (b"ftyp", b"moov", b"mdat", b"wide", b"free", b"skip", b"pnot")
"""The types of the first box of MP4 and QuickTime, from the fifth byte."""
_PACKETS = ((188, 0), (192, 4))
"""The lengths of packets of MPEG transport streams, and the position of the sync byte 0x47."""

_LISTS = {
    b"#EXTM3U": "an HLS playlist",
    b"ffconcat": "a list of files for FFmpeg",
    b"v=0": "a description of a network stream (SDP)",
    b"<ASX": "a playlist (ASX)",
    b"<?xml": "an XML file",
    b"[playlist]": "a playlist (PLS)",
}


class VideoError(ValueError):
    """A file cannot be read as a video."""


def is_video(head: bytes) -> bool:
    """Whether the first bytes of a file are those of a known container."""
    if head[:4] == b"RIFF":
        return head[8:12] == b"AVI "
    if head.startswith(_STARTS) or head[4:8] in _BOXES:
        return True
    return any(
        len(head) > place + 2 * length
        and head[place] == head[place + length] == head[place + 2 * length] == 0x47
        for length, place in _PACKETS
    )


def check_container(path: Path) -> None:
    """Check that a file is a known container.

    Raises:
        VideoError: If it is not.
        OSError: If it cannot be read.
    """
    # reading a pipe or a device could block
    with os.fdopen(os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0)), "rb") as file:
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            raise VideoError("it is a pipe or device; copy what it gives into a file")
        head = file.read(HEAD)
    if not is_video(head):
        text = head.lstrip(b"\xef\xbb\xbf \t\r\n").lower()
        found = next((word for sign, word in _LISTS.items() if text.startswith(sign.lower())), None)
        if found is not None:
            raise VideoError(f"it is {found}, which leads to other files; name the video itself")
        raise VideoError("its first bytes are those of no video" if head else "it is empty")


def open_video(path: Path, *, packets: bool = False) -> cv2.VideoCapture:
    """Open a video by FFmpeg, after a check of its container.

    Args:
        path: A local file.
        packets: Whether to read compressed packets rather than pictures.

    Raises:
        VideoError: If the file is not a known container.
        OSError: If it cannot be read.
    """
    check_container(path)
    wish = [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, PATIENCE_MS, cv2.CAP_PROP_READ_TIMEOUT_MSEC]
    wish += [PATIENCE_MS, *([cv2.CAP_PROP_FORMAT, -1] if packets else [])]
    return cv2.VideoCapture(str(path), cv2.CAP_FFMPEG, wish)
