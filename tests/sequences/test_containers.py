"""What is opened as a video, told by its content: no list of other files, no network, no pipe."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.synthetic import CODECS, write_video
from tracker.sequences.pictures.containers import VideoError, check_container, is_video, open_video
from tracker.sequences.pictures.video import index_video, read_image

LISTS = {
    "hls": "#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\na.mp4\n#EXT-X-ENDLIST\n",
    "concat": "ffconcat version 1.0\nfile a.mp4\n",
    "sdp": "v=0\no=- 0 0 IN IP4 127.0.0.1\ns=a.mp4\nc=IN IP4 127.0.0.1\nt=0 0\n"
    "m=video 5004 RTP/AVP 96\na=rtpmap:96 H264/90000\n",
}


@pytest.mark.parametrize("kind", LISTS)
def test_ffmpeg_itself_opens_no_list(
    tmp_path: Path, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where the first bytes deceive us."""
    from tracker.sequences.pictures import containers

    monkeypatch.setattr(containers, "check_container", lambda path: None)
    inside = tmp_path / "a.mp4"
    write_video(inside, range(8), CODECS["mp4"])
    playlist = tmp_path / "list.m3u8"
    playlist.write_text(LISTS[kind])
    assert not open_video(playlist).isOpened()
    assert open_video(inside).isOpened()


def test_numbered_pictures_are_no_video(tmp_path: Path) -> None:
    for number in range(3):
        cv2.imwrite(str(tmp_path / f"i{number}.jpg"), np.zeros((48, 64, 3), np.uint8))
    video = tmp_path / "i%d.jpg"
    write_video(tmp_path / "i.avi", range(5), "MJPG")
    (tmp_path / "i.avi").rename(video)
    with pytest.raises(VideoError, match="no picture in it can be decoded"):
        index_video(video)


def test_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe.mp4"
    os.mkfifo(pipe)
    with pytest.raises(VideoError, match="pipe or device"):
        check_container(pipe)
    with pytest.raises(VideoError, match="pipe or device"):
        check_container(Path("/dev/zero"))
    assert read_image(pipe) is None
    assert read_image(Path("/dev/zero")) is None


@pytest.mark.parametrize("container", ["mp4", "avi", "mkv", "mjpg"])
def test_what_cameras_write_is_opened(tmp_path: Path, container: str) -> None:
    path = tmp_path / f"v.{container}"
    write_video(path, range(5), "MJPG" if container in ("avi", "mjpg") else "mp4v")
    assert is_video(path.read_bytes()[:600])
    assert index_video(path).frames == 5


def test_stream_packets_are_known() -> None:
    packet = b"\x47" + bytes(187)
    assert is_video(packet * 4)
    assert is_video((bytes(4) + packet) * 4)  # as of camcorders
    assert not is_video(b"\x47" + bytes(700))
    assert not is_video(b"RIFF\0\0\0\0WEBP")


LIMITED = """
import resource, sys
from pathlib import Path
from tracker.sequences.pictures.video import VideoError, index_video, read_image
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
try:
    index_video(Path(sys.argv[1]))
except VideoError as error:
    assert "12000" in str(error), error
else:
    raise SystemExit("the video was taken")
assert read_image(Path(sys.argv[2])) is None
assert read_image(Path(sys.argv[3])) is None
grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
assert grown < 100, grown
"""


@pytest.mark.full
def test_a_huge_picture_is_refused_before_it_is_decoded(tmp_path: Path) -> None:
    picture = np.full((12000, 12000, 3), 90, np.uint8)
    video, image, sparse = tmp_path / "v.avi", tmp_path / "i.jpg", tmp_path / "s.png"
    writer = cv2.VideoWriter(
        str(video), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*"MJPG"), 25.0, (12000, 12000)
    )
    writer.write(picture)
    writer.release()
    cv2.imwrite(str(image), picture)
    with sparse.open("wb") as file:
        file.truncate(2**33)
    done = subprocess.run([sys.executable, "-c", LIMITED, video, image, sparse], check=False)
    assert done.returncode == 0
