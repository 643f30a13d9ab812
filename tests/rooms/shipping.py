"""The built-in sequences as data of the program, made from what the generator renders."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path

import av
from numpy import ndarray

from tests.rooms.folder import render
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.reader import FILE, read_sequence

STEPS = 600
"""The first of a room: people enter, meet and hide each other, and everybody is in view."""

TRUTH = "ground_truth.csv"

ENCODER = {
    "crf": "21",  # the three rooms together are just below 8 MB
    "preset": "veryslow",
    "bf": "0",  # with the next line a jump decodes few pictures more than the one that is wanted
    "g": "16",
    "keyint_min": "16",
    "sc_threshold": "0",
    "threads": "1",  # the same file on every machine with the same x264
}
"""Options of x264."""

CONTAINER = {"movflags": "+faststart", "fflags": "+bitexact"}


def ship(name: str, folder: Path) -> None:
    """Render a built-in room and write it as the program carries it.

    Args:
        name: Of the room.
        folder: Its folder; what it has of the files is written over.
    """
    with tempfile.TemporaryDirectory() as place:
        rendered = Path(place) / name
        render(name, rendered, frames=STEPS)
        write_shipped(rendered, folder)


def write_shipped(rendered: Path, folder: Path) -> None:
    """Write a rendered folder with H.264 in place of Motion-JPEG.

    Args:
        rendered: From the generator.
        folder: Where the shipped files go.
    """
    folder.mkdir(parents=True, exist_ok=True)
    sequence = read_sequence(rendered)
    with FrameReader(sequence) as reader:
        for index, camera in enumerate(sequence.cameras):
            path = folder / f"{camera.name}.mp4"
            encode(reader.iterate(index), path, camera.image_size, sequence.fps)
    text = (rendered / FILE).read_text(encoding="utf-8")
    (folder / FILE).write_text(shipped_text(text), encoding="utf-8")
    shutil.copyfile(rendered / TRUTH, folder / TRUTH)


def shipped_text(rendered: str) -> str:
    """The text of a rendered ``sequence.toml`` as it is shipped: with the other videos."""
    return rendered.replace('.avi"', '.mp4"')


def encode(
    pictures: Iterable[ndarray | None], path: Path, size: tuple[int, int], fps: float
) -> None:
    """Write pictures (blue-green-red) as H.264 with colours at full resolution.

    At half the resolution, which is usual, clothes lose so much that the filter's error in the
    hardest room grew from 0.072 to 0.086 m; at full resolution it is 0.069 m, in as many bytes.
    """
    with av.open(str(path), "w", format="mp4", options=CONTAINER) as file:
        stream = file.add_stream("libx264", rate=Fraction(fps), options=ENCODER)
        stream.width, stream.height = size
        stream.pix_fmt = "yuv444p"
        for picture in pictures:
            assert picture is not None
            file.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="bgr24")))
        file.mux(stream.encode())
