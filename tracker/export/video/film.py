"""The MP4 (H.264): one frame a step, decoded, drawn and encoded one after the other."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import ExitStack, closing
from fractions import Fraction
from pathlib import Path

from tracker.export.video.drawing import Mosaic
from tracker.export.written import Options, Written
from tracker.sequences.pictures.frames import FrameReader, Picture

_QUALITY = {"preset": "veryfast", "crf": "20"}
_FINEST_RATE = 1000
"""Frames a second are told as a fraction of so many parts at most."""


def write(path: Path, written: Written, options: Options) -> None:
    """Write the file; its frame k shows step ``options.first`` + k.

    Raises:
        ValueError: If the range or the speed make no film.
        Stopped: If it is not wanted any more.
    """
    import av

    first = options.first
    last = written.steps - 1 if options.last is None else min(options.last, written.steps - 1)
    if not 0 <= first <= last:
        raise ValueError(
            f"a video from step {first} to {last}: expected two of 0 … {written.steps - 1}, "
            "the first not after the last"
        )
    if not 0.01 <= options.speed <= 100.0:
        raise ValueError(f"a video at speed {options.speed:g}: expected 0.01 … 100")
    mosaic = Mosaic(written)
    total = last - first + 1
    rate = Fraction(written.sequence.fps * options.speed).limit_denominator(_FINEST_RATE)
    with av.open(str(path), "w", format="mp4") as file:
        stream = file.add_stream("libx264", rate=rate, options=_QUALITY)
        stream.width, stream.height = mosaic.size
        stream.pix_fmt = "yuv420p"
        stream.codec_context.thread_type = "AUTO"
        with ExitStack() as stack:
            reader = stack.enter_context(FrameReader(written.sequence))
            walks = [
                stack.enter_context(closing(_walk(reader, camera, first)))
                for camera in range(len(written.sequence.views))
            ]
            for step in range(first, last + 1):
                options.at(step - first, total)
                drawn = mosaic.draw(step, [next(walk, None) for walk in walks])
                file.mux(stream.encode(av.VideoFrame.from_ndarray(drawn, format="bgr24")))
        file.mux(stream.encode())
    options.at(total, total)


def _walk(reader: FrameReader, camera: int, first: int) -> Generator[Picture | None, None, None]:
    yield from reader.iterate(camera, first)
