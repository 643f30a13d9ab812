"""Four cameras of 1920×1080 pixels from files to people, and where the time goes."""

from __future__ import annotations

import tempfile
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import av

from tests.benchmarks.measure import Measurement
from tests.rooms.random_rooms import choose, render_chosen
from tracker.runs import pipeline
from tracker.runs.run import Progress, Run
from tracker.runs.single_views import _CameraWorker
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.pictures.video import VideoDecoder
from tracker.sequences.reader import read_sequence
from tracker.sequences.sequence import Sequence
from tracker.single_view.colour.appearance import Appearance
from tracker.single_view.colour.peaks import PeakFinder
from tracker.single_view.rectification.view import RectifiedView
from tracker.single_view.shape.finder import ShapeFinder

ROOM = 33
"""Four cameras, three people with a template each, who sit and stand, and changing light: colours,
foreground and shapes are all looked at."""
SIZE = (1920, 1080)

Seconds = defaultdict[str, float]
"""Of a processor, by part."""

_STAGE_ONE = "the rest of stage 1"
_PARTS: tuple[tuple[type, str, str], ...] = (
    (VideoDecoder, "read", "decoding"),
    (RectifiedView, "picture", "reducing"),
    (Appearance, "prepare", "colours and foreground"),
    (ShapeFinder, "find", "shapes"),
    (PeakFinder, "_sample", "sampling"),
    (PeakFinder, "_score", "scoring"),
    (PeakFinder, "_climb", "mean shift"),
    (_CameraWorker, "block", _STAGE_ONE),
)
"""What is timed. The last holds all the others."""


def run(short: bool) -> Iterator[Measurement]:
    """A rendered room, its videos H.264 as cameras write them; compiled before it is timed."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "room"
        chosen = replace(choose(ROOM), image_size=SIZE, compression="weak")
        render_chosen(chosen, folder, frames=24 if short else 100)
        _as_h264(folder, chosen.fps)
        sequence = read_sequence(folder)
        parameters = pipeline.default_parameters(sequence)
        pipeline.compute(sequence, parameters, steps=6)
        what = f"{len(sequence.views)} cameras {SIZE[0]}×{SIZE[1]}, {parameters.single_view}"
        spent: Seconds = defaultdict(float)
        with _timed(spent):
            clocks = _compute(sequence, spent)
        steps = sequence.frames - clocks.first
        seconds = clocks.end - clocks.begin
        yield Measurement(
            f"{what}, decoding included", steps / seconds, "steps/s", "≥ 12 with two cores"
        )
        yield Measurement(f"{what}: first step after", clocks.preparing, "s")
        each = 1000.0 / steps
        yield Measurement(f"{what}: processor time", each * clocks.work, "ms a step")
        spent[_STAGE_ONE] -= sum(spent[part] for _, _, part in _PARTS[:-1])
        # decoders work in threads of their own, whose time only the whole process tells
        spent["decoding"] = _decoding(sequence) / sequence.frames * steps
        for part in sorted(spent, key=lambda part: -spent[part]):
            yield Measurement(f"{what}: {part} alone", each * spent[part], "ms a step")


class _Clocks:
    """When and with how much work a run came from its first steps to its end."""

    def __init__(self) -> None:
        self.started = time.perf_counter()
        self.first = 0
        self.preparing = self.begin = self.end = self.work = 0.0


def _compute(sequence: Sequence, spent: Seconds) -> _Clocks:
    clocks = _Clocks()
    at_first: Seconds = defaultdict(float)

    def told(run: Run, _: Progress) -> None:
        if not clocks.first and run.done:
            clocks.first, clocks.begin = run.done, time.perf_counter()
            clocks.preparing = clocks.begin - clocks.started
            clocks.work = time.process_time()
            at_first.update(spent)
            at_first["fusion and smoothing"] = time.thread_time()

    pipeline.compute(sequence, pipeline.default_parameters(sequence), on_progress=told)
    clocks.end = time.perf_counter()
    clocks.work = time.process_time() - clocks.work
    spent["fusion and smoothing"] = time.thread_time()
    for part in spent:
        spent[part] -= at_first[part]
    return clocks


def _decoding(sequence: Sequence) -> float:
    """Processor seconds for nothing but all pictures."""
    begin = time.process_time()
    with FrameReader(sequence) as reader:
        for camera in range(len(sequence.views)):
            for picture in reader.iterate(camera):
                assert picture is not None
    return time.process_time() - begin


@contextmanager
def _timed(spent: Seconds) -> Iterator[None]:
    """Have the seconds of each part counted, of the thread that it runs in."""
    guard = threading.Lock()
    own = [getattr(kind, name) for kind, name, _ in _PARTS]

    def counting(function: Callable[..., Any], part: str) -> Callable[..., Any]:
        def counted(*arguments: Any, **named: Any) -> Any:
            begin = time.thread_time()
            try:
                return function(*arguments, **named)
            finally:
                with guard:
                    spent[part] += time.thread_time() - begin

        return counted

    for (kind, name, part), function in zip(_PARTS, own, strict=True):
        setattr(kind, name, counting(function, part))
    try:
        yield
    finally:
        for (kind, name, _), function in zip(_PARTS, own, strict=True):
            setattr(kind, name, function)


def _as_h264(folder: Path, fps: float) -> None:
    """Write a sequence's videos anew as cameras do: pictures told by those before."""
    with FrameReader(read_sequence(folder)) as reader:
        for camera, source in enumerate(sorted(folder.glob("*.avi"))):
            with av.open(str(source.with_suffix(".mp4")), "w") as file:
                stream: Any = file.add_stream(
                    "libx264", rate=Fraction(fps), options={"preset": "veryfast", "crf": "21"}
                )
                stream.width, stream.height = SIZE
                stream.pix_fmt = "yuv420p"
                for picture in reader.iterate(camera):
                    assert picture is not None
                    file.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="bgr24")))
                file.mux(stream.encode())
    described = folder / "sequence.toml"
    described.write_text(described.read_text("utf-8").replace(".avi", ".mp4"), encoding="utf-8")
