"""The steps of a recording, and which of them each camera's frames belong to."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np
from jaxtyping import Int
from numpy import ndarray

from tracker.io.conventions.questions import ACCEPT
from tracker.io.importing.finding.matching import Matched, MatchedCamera
from tracker.io.importing.options import ImportOptions
from tracker.io.read.columns import frames_of_times, parts_of_date
from tracker.io.read.pieces import DetectionPiece, FormatError, TruthPiece, VideoPiece
from tracker.io.read.source import number_in
from tracker.sequences.clock import Clock, Timing
from tracker.sequences.fields import LARGEST_COUNT

USUAL_RATE = 25.0
"""Steps a second where no file says."""

SAME_RATE = 0.002
"""By how much rates may differ that are the same: 29.97 and 30 are not within ten minutes."""


@dataclass(frozen=True, slots=True, eq=False)
class CameraTime:
    """The clock of one camera."""

    timing: Timing
    clock: Clock | None
    """None where frame k is that of step k."""

    def steps_of(self, frames: Int[ndarray, " N"]) -> Int[ndarray, " N"]:
        """The step of each frame of the file, -1 where it belongs to none."""
        return frames if self.clock is None else self.clock.steps_of(frames)


@dataclass(frozen=True, slots=True, eq=False)
class CommonTimes:
    """The steps, and the clock of every camera."""

    fps: float
    stated: bool
    """Whether a file or a flag says the rate."""
    frames: int
    """The number of steps."""
    cameras: tuple[CameraTime, ...]


_Rows = TypeVar("_Rows", DetectionPiece, TruthPiece)


def counted_alike(matched: Matched, fps: float | None, found: list[tuple[str, str]]) -> Matched:
    """Count the frames of boxes and truth from the first picture, or from the first date of all.

    Pictures may be called by the frames of a video of which they are every tenth, or by their
    times; that is so where more rows are of a picture by its number than by its place. Without
    pictures frames are counted from the first, if there are fewer after it than before.

    Args:
        matched: The cameras with their pictures and boxes, and the truth.
        fps: Steps a second, if that is stated.
        found: What was found out is added.
    """
    numbers = [_numbers_of(camera) for camera in matched.cameras]
    cameras = [
        camera
        if camera.detections is None
        else replace(camera, detections=_at_place(camera.detections, own))
        for camera, own in zip(matched.cameras, numbers, strict=True)
    ]
    first = next((own for own in numbers if own is not None), None)
    truths = [(label, _at_place(truth, first)) for label, truth in matched.truths]
    counted = [
        new.raw.name
        for new, old in zip(cameras, matched.cameras, strict=True)
        if new.detections is not old.detections
    ]
    if counted:
        found.append(("frames", f"the numbers in the names of pictures of {', '.join(counted)}"))
    seen = [camera.detections for camera in cameras if camera.detections is not None]
    pieces = on_one_clock([*seen, *(truth for _, truth in truths)], fps)
    begin = min((int(p.frames.min()) for p in pieces if len(p.frames)), default=0)
    end = max((int(p.frames.max()) for p in pieces if len(p.frames)), default=0)
    if begin > end - begin + 1 and not any(camera.video or camera.images for camera in cameras):
        pieces = [_later(replace(piece, first_index=0), -begin) for piece in pieces]
        found.append(("frames", f"counted from {begin}, the first that any file names"))
    clocked = iter(pieces)
    cameras = [
        camera if camera.detections is None else replace(camera, detections=next(clocked))
        for camera in cameras
    ]
    truths = [(label, next(clocked)) for label, _ in truths]
    return replace(matched, cameras=cameras, truths=truths)


def on_one_clock(
    pieces: Sequence[DetectionPiece | TruthPiece], fps: float | None = None
) -> list[Any]:
    """Count frames that have times at one rate, and those with dates from the first of all pieces.

    Of each piece alone they begin at 0 and have the rate of its rows. Numbers of frames that are
    dates, as in the names of pictures, become frames too.

    Args:
        pieces: Boxes and truth.
        fps: Steps a second; if None, the highest rate of the pieces where they differ.
    """
    pieces = [_of_dates(piece) for piece in pieces]
    rates = [piece.fps for piece in pieces if piece.fps]
    if rates and max(rates) / min(rates) - 1.0 > SAME_RATE:
        common = max(rates) if fps is None else fps
        pieces = [_at_rate(common, piece) if piece.fps else piece for piece in pieces]
    begin = min((piece.begins for piece in pieces if piece.begins is not None), default=0.0)
    return [piece if piece.begins is None else _since(begin, piece) for piece in pieces]


def _at_rate(fps: float, piece: DetectionPiece | TruthPiece) -> DetectionPiece | TruthPiece:
    ratio = fps / (piece.fps or fps)
    return _counted(replace(piece, fps=fps), lambda frames: np.round(frames * ratio))


def _of_dates(piece: DetectionPiece | TruthPiece) -> DetectionPiece | TruthPiece:
    if len(np.unique(piece.frames)) < 2 or parts_of_date(float(piece.frames.min())) is None:
        return piece
    frames, when = frames_of_times(piece.frames.astype(float))
    piece = replace(piece, frames=frames, fps=when.fps, begins=when.begins, first_index=0)
    return replace(piece, last_frame=None) if isinstance(piece, DetectionPiece) else piece


def _since(begin: float, piece: DetectionPiece | TruthPiece) -> DetectionPiece | TruthPiece:
    later = round(((piece.begins or 0.0) - begin) * (piece.fps or 0.0))
    return _later(replace(piece, begins=begin), later)


def _later(piece: DetectionPiece | TruthPiece, frames: int) -> DetectionPiece | TruthPiece:
    return _counted(piece, lambda own: own + frames)


def _counted(
    piece: DetectionPiece | TruthPiece, count: Callable[[ndarray], ndarray]
) -> DetectionPiece | TruthPiece:
    """A piece with its frames, and the last that was looked at, counted otherwise."""
    piece = replace(piece, frames=count(piece.frames).astype(np.int64))
    if isinstance(piece, DetectionPiece) and piece.last_frame is not None:
        return replace(piece, last_frame=int(count(np.array(piece.last_frame))))
    return piece


def _numbers_of(camera: MatchedCamera) -> Int[ndarray, " F"] | None:
    """The numbers of a camera's pictures, ascending; None if it has none, or not all do."""
    if camera.images is None:
        return None
    numbers = [number_in(path.name) for path in camera.images.files]
    found = np.array([number for number in numbers if number is not None], dtype=np.int64)
    return found if len(found) == len(numbers) and (np.diff(found) > 0).all() else None


def _at_place(piece: _Rows, numbers: Int[ndarray, " F"] | None) -> _Rows:
    if numbers is None or not len(piece.frames):
        return piece
    place = np.minimum(np.searchsorted(numbers, piece.frames), len(numbers) - 1)
    there = numbers[place] == piece.frames
    by_place = max(
        int(((piece.frames >= first) & (piece.frames < first + len(numbers))).sum())
        for first in (0, 1)
    )
    if int(there.sum()) <= by_place:
        return piece
    # of a picture that is not there: far behind the last
    frames = np.where(there, place, 2 * len(numbers) + 2)
    piece = replace(piece, frames=frames, first_index=0)
    return replace(piece, last_frame=None) if isinstance(piece, DetectionPiece) else piece


def settle_times(
    cameras: Sequence[MatchedCamera],
    truths: Sequence[tuple[str, TruthPiece]],
    options: ImportOptions,
    found: list[tuple[str, str]],
) -> CommonTimes:
    """Steps and rate: those of the pictures, else those of the boxes.

    Args:
        cameras: With what belongs to each.
        truths: Whose files may state a rate.
        options: What is known better.
        found: What was found out is added.

    Raises:
        FormatError: If there is no step, or there are more than a recording has.
    """
    stated = _rate(cameras, truths, options, found)
    fps = USUAL_RATE if stated is None else stated
    timings = [_timing(camera, fps, options) for camera in cameras]
    stamped = [timing.stamps[0] for timing in timings if timing.stamps]
    beginning = min(stamped, default=0.0)
    counts = [
        int(np.floor(timing.seconds(frames, fps, beginning) * fps + 1e-6))
        for camera, timing in zip(cameras, timings, strict=True)
        if (frames := _pictures(camera)) is not None
    ]
    if counts:
        frames = min(counts)
        if max(counts) > frames:
            found.append(
                ("frames", f"{frames}, those of the shortest of {min(counts)} … {max(counts)}")
            )
    else:
        lasts = [
            max(int(c.detections.frames.max(initial=-1)), c.detections.last_frame or 0)
            - first_index(c.detections, options, None)
            for c in cameras
            if c.detections is not None
        ]
        frames = max(lasts, default=-1) + 1
        found.append(("frames", f"{frames}, up to the last that the boxes name"))
    if not 0 < frames <= LARGEST_COUNT:
        raise FormatError(
            f"expected 1 to {LARGEST_COUNT:,} steps in videos, pictures or boxes, found {frames}"
        )
    own = tuple(
        CameraTime(timing, timing.clock(fps, frames, beginning if timing.stamps else 0.0))
        for timing in timings
    )
    return CommonTimes(fps, stated is not None, frames, own)


def _pictures(camera: MatchedCamera) -> int | None:
    """How many frames a camera has pictures of."""
    if camera.video is not None:
        return camera.video.frames
    return None if camera.images is None else len(camera.images.files)


def _timing(camera: MatchedCamera, fps: float, options: ImportOptions) -> Timing:
    offset = options.offsets.get(camera.raw.name, 0.0)
    if camera.times is not None:
        return Timing(time_offset=offset, stamps=tuple(camera.times.times.tolist()))
    return Timing(fps=_own_rate(camera.video, fps), time_offset=offset)


def _own_rate(video: VideoPiece | None, fps: float) -> float | None:
    """The rate of a camera's video where it is another than that of the steps."""
    if video is None or video.fps <= 0.0 or abs(video.fps / fps - 1.0) <= SAME_RATE:
        return None
    return video.fps


def _rate(
    cameras: Sequence[MatchedCamera],
    truths: Sequence[tuple[str, TruthPiece]],
    options: ImportOptions,
    found: list[tuple[str, str]],
) -> float | None:
    """Steps a second: as time stamps say, else the videos' usual rate, else that of boxes
    and truth."""
    if options.fps is not None:
        return options.fps
    stamps = [c.times.times for c in cameras if c.times is not None and len(c.times.times) > 1]
    if stamps:
        rates = [float((len(own) - 1) / (own[-1] - own[0])) for own in stamps if own[-1] > own[0]]
        fps = round(float(np.max(rates)), 3) if rates else USUAL_RATE
        found.append(("fps", f"{fps:g}, by the time stamps of {len(stamps)} cameras; --fps"))
        return fps
    rates = [c.video.fps for c in cameras if c.video is not None and c.video.fps > 0.0]
    if not rates:
        pieces = [c.detections for c in cameras if c.detections is not None]
        rates = [own.fps for own in pieces if own.fps is not None]
        rates += [truth.fps for _, truth in truths if truth.fps is not None]
        if rates:
            rate = sorted(rates)[len(rates) // 2]
            found.append(("fps", f"{rate:g}, by the files of boxes or truth; --fps"))
    if not rates:
        return None
    fps = sorted(rates)[len(rates) // 2]
    for camera in cameras:
        own = _own_rate(camera.video, fps)
        if own is not None:
            found.append((f"{camera.raw.name} fps", f"{own:.6g}, the steps have {fps:.6g}"))
    return fps


def first_index(piece: DetectionPiece, options: ImportOptions, frames: int | None) -> int:
    """The number of the first frame in a file of boxes."""
    if options.first_index is not None:
        return options.first_index
    # a frame that is called 0 says more than what is usual in a format
    if len(piece.frames) == 0 or piece.frames.min() == 0:
        return 0
    if piece.first_index is not None:
        return piece.first_index
    last = max(int(piece.frames.max()), piece.last_frame or 0)
    return 1 if piece.frames.min() == 1 and (frames is None or last >= frames) else 0


def check_common(steps: Mapping[str, Int[ndarray, " D"]]) -> None:
    """Check that the boxes of cameras are of the same steps, where these prove nothing.

    Args:
        steps: The steps of the boxes of each camera, by its name.

    Raises:
        FormatError: If two cameras have boxes during less than half of the shortest recording.
    """
    spans = {name: (int(own.min()), int(own.max()) + 1) for name, own in steps.items() if len(own)}
    if len(spans) < 2:
        return
    # steps that begin a span count one more camera from there on, those that end one, one less
    edges = sorted(
        [(first, 1) for first, _ in spans.values()] + [(e, -1) for _, e in spans.values()]
    )
    common, cameras, before = 0, 0, 0
    for edge, change in edges:
        common += (edge - before) * (cameras > 1)
        cameras, before = cameras + change, edge
    if 2 * common < min(end - first for first, end in spans.values()):
        listed = ", ".join(f"{name} {first} … {end - 1}" for name, (first, end) in spans.items())
        raise FormatError(
            f"the boxes of cameras are of other frames ({listed}), so that nothing tells whether "
            "they belong together: count the frames of all of them from one moment; "
            f"{ACCEPT} imports them as they are"
        )


def told_beyond(piece: DetectionPiece, first: int, frames: int) -> str:
    """A sentence about boxes of frames that are not there; empty where all are.

    Args:
        piece: The boxes.
        first: The number of the first frame, as it is taken.
        frames: How many there are.
    """
    steps = piece.frames - first
    before, behind = int((steps < 0).sum()), int((steps >= frames).sum())
    if not before and not behind:
        return ""
    if before and not behind and int(steps.min()) == -1:
        return (
            f"{piece.source.name}: {before} of {len(steps)} boxes are of frame {first - 1}, so "
            f"frames are counted from {first - 1}, not from {first}: --first-index {first - 1}"
        )
    if behind and not before and first == 0 and int(steps.max()) == frames:
        return (
            f"{piece.source.name}: {behind} of {len(steps)} boxes are of frame {frames}, the one "
            f"after the last of {frames}, so frames are counted from 1: --first-index 1"
        )
    where = [f"before frame {first}, the first"] if before else []
    where += [f"after frame {first + frames - 1}, the last"] if behind else []
    return (
        f"{piece.source.name}: {before + behind} of {len(steps)} boxes are left out: of frames "
        f"{' and '.join(where)} of the recording"
    )


def frames_of(camera: MatchedCamera, time: CameraTime, steps: int) -> int:
    """How many frames the file of a camera has that may have boxes."""
    if time.clock is None:
        return steps
    return _pictures(camera) or len(time.clock.step_of_frame)
