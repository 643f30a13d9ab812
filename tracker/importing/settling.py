"""From matched files to what a sequence needs: conventions, sizes, rate, room and target."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.agreement.observed import rays_of
from tracker.agreement.suggestion import STANDING, Suggestion, agreement, suggest
from tracker.camera import Camera
from tracker.checks.reading import Reading, read_boxes, to_camera
from tracker.checks.readings import Open, Seen, find_meaning
from tracker.formats.pieces import (
    DetectionPiece,
    FormatError,
    Layout,
    RawCamera,
    TruthPiece,
    VideoPiece,
)
from tracker.importing.calibrations import camera_sets
from tracker.importing.gathering import Taken
from tracker.importing.geometry import read_poses
from tracker.importing.matching import MatchedCamera, match_all
from tracker.importing.options import ImportOptions
from tracker.importing.pictures import picture_sizes, scaled
from tracker.importing.truths import settle_truth
from tracker.sequences.sequence import Detections, GroundTruth

USUAL_RATE = 25.0
"""Steps a second where no file says."""

ROOM_MARGIN = 1.0
"""Metres on each side: a room that is too large costs little, who is outside is lost."""

PERSON = 1.70
"""Metres: the usual stature, by which a reconstruction without a unit is scaled."""

SAME_RATE = 0.002
"""By how much rates may differ that are the same: 29.97 and 30 are not within ten minutes."""

MOST_FRAMES = 10_000_000

_WITHOUT_UNIT = ("COLMAP", "nerfstudio")
"""Formats whose unit is arbitrary."""


@dataclass(frozen=True, slots=True, eq=False)
class SettledView:
    """One camera, ready to be written."""

    camera: Camera
    matched: MatchedCamera
    detections: Detections | None


@dataclass(frozen=True, slots=True, eq=False)
class Settled:
    """A recording, ready to be written, and what was found out on the way."""

    views: tuple[SettledView, ...]
    fps: float
    frames: int
    room: Suggestion
    truth: GroundTruth | None
    reading: Reading
    found: tuple[tuple[str, str], ...]
    """What was not in the files or had to be chosen, and why it is so."""
    told: tuple[str, ...]
    """Sentences about what is not used or odd."""


def settle(taken: Sequence[Taken], options: ImportOptions | None = None) -> Settled:
    """Find out everything that a sequence needs.

    Raises:
        FormatError: If there is no calibration, or files contradict each other; the sentence
            says which and what to do.
    """
    options = options or ImportOptions()
    sets, told = camera_sets(taken)
    matched = match_all(taken, sets, options)
    told += matched.told
    found: list[tuple[str, str]] = []
    cameras = matched.cameras
    for way in sorted({how for camera in cameras for how in camera.how.values()} - {"name"}):
        found.append(("matching", f"pictures and boxes go to the cameras by {way}"))
    sizes = picture_sizes(cameras, found)
    raws = [
        _told(scaled(camera.raw, size), options)
        for camera, size in zip(cameras, sizes, strict=True)
    ]
    frames, fps = _time(cameras, matched.truths, options, found)
    boxes = _boxes(cameras, sizes, frames, fps, options, found, told)
    ratios = [fps / (own_rate(camera.video, fps) or fps) for camera in cameras]
    arbitrary = matched.format.startswith(_WITHOUT_UNIT)
    reading, raws, boxes = _read(raws, boxes, ratios, arbitrary, found)
    settled = [to_camera(raw, reading, size) for raw, size in zip(raws, sizes, strict=True)]
    detections = [_detections(own) for own in boxes]
    at_steps = [
        None if own is None else replace(own, frames=_steps(own.frames, ratio))
        for own, ratio in zip(detections, ratios, strict=True)
    ]
    room = _room(settled, at_steps, found)
    truth = settle_truth(
        [piece for _, piece in matched.truths],
        settled,
        at_steps,
        reading,
        frames,
        float(room.half_extents[2]) + room.floor,
        options.first_index,
        found,
    )
    views = tuple(
        SettledView(camera, own, boxes_)
        for camera, own, boxes_ in zip(settled, cameras, detections, strict=True)
    )
    return Settled(views, fps, frames, room, truth, reading, tuple(found), tuple(told))


def _told(raw: RawCamera, options: ImportOptions) -> RawCamera:
    """With what the flags say in place of what the format says."""
    convention = replace(
        raw.convention,
        direction=options.pose or raw.convention.direction,
        axes=options.axes or raw.convention.axes,
        up=options.up or raw.convention.up,
    )
    if isinstance(options.unit, float):
        return _resized(replace(raw, convention=replace(convention, unit="m")), options.unit)
    unit = options.unit or convention.unit
    return replace(raw, convention=replace(convention, unit=unit))


def _resized(raw: RawCamera, factor: float) -> RawCamera:
    """With another unit."""
    if raw.projection is not None:
        return replace(raw, projection=raw.projection @ np.diag([1.0, 1.0, 1.0, factor]))
    assert raw.translation is not None
    return replace(raw, translation=raw.translation * factor)


def _time(
    cameras: Sequence[MatchedCamera],
    truths: Sequence[tuple[str, TruthPiece]],
    options: ImportOptions,
    found: list[tuple[str, str]],
) -> tuple[int, float]:
    """Steps and rate: those of the pictures, else those of the boxes."""
    fps = _rate(cameras, truths, options, found)
    counts = [_in_steps(c.video, fps, c.video.frames) for c in cameras if c.video is not None]
    counts += [len(c.images.files) for c in cameras if c.images is not None]
    if counts:
        frames = min(counts)
        if max(counts) > frames:
            found.append(
                ("frames", f"{frames}, those of the shortest of {min(counts)} … {max(counts)}")
            )
    else:
        lasts = [
            max(int(c.detections.frames.max(initial=-1)), c.detections.last_frame or 0)
            - _first_index(c.detections, options, None)
            for c in cameras
            if c.detections is not None
        ]
        frames = max(lasts, default=-1) + 1
        found.append(("frames", f"{frames}, up to the last that the boxes name"))
    if not 0 < frames <= MOST_FRAMES:
        raise FormatError(
            f"expected 1 to {MOST_FRAMES:,} steps in videos, pictures or boxes, found {frames}"
        )
    return frames, fps


def own_rate(video: VideoPiece | None, fps: float) -> float | None:
    """The rate of a camera's video where it is another than that of the steps."""
    if video is None or video.fps <= 0.0 or abs(video.fps / fps - 1.0) <= SAME_RATE:
        return None
    return video.fps


def _in_steps(video: VideoPiece | None, fps: float, frames: int) -> int:
    """So many frames of a video as steps."""
    rate = own_rate(video, fps)
    return frames if rate is None else int(frames * fps / rate)


def _rate(
    cameras: Sequence[MatchedCamera],
    truths: Sequence[tuple[str, TruthPiece]],
    options: ImportOptions,
    found: list[tuple[str, str]],
) -> float:
    """Steps a second: the videos' usual rate, else that of the truth's file."""
    if options.fps is not None:
        return options.fps
    rates = [c.video.fps for c in cameras if c.video is not None and c.video.fps > 0.0]
    if not rates:
        rates = [truth.fps for _, truth in truths if truth.fps is not None]
    if not rates:
        found.append(("fps", f"{USUAL_RATE:g}, since no file says it; --fps"))
        return USUAL_RATE
    fps = sorted(rates)[len(rates) // 2]
    for camera in cameras:
        own = own_rate(camera.video, fps)
        if own is not None:
            found.append((f"{camera.raw.name} fps", f"{own:.6g}, the steps have {fps:.6g}"))
    return fps


def _steps(frames: Int[ndarray, " D"], ratio: float) -> Int[ndarray, " D"]:
    """The step nearest to each frame of a camera with a rate of its own."""
    return np.round(frames * ratio).astype(np.int64)


def _first_index(piece: DetectionPiece, options: ImportOptions, frames: int | None) -> int:
    """The number of the first frame in a file of boxes."""
    if options.first_index is not None:
        return options.first_index
    if piece.first_index is not None:
        return piece.first_index
    if len(piece.frames) == 0 or piece.frames.min() == 0:
        return 0
    last = max(int(piece.frames.max()), piece.last_frame or 0)
    return 1 if piece.frames.min() == 1 and (frames is None or last >= frames) else 0


_Boxes = tuple[Detections, Layout | None]


def _boxes(
    cameras: Sequence[MatchedCamera],
    sizes: Sequence[tuple[int, int]],
    frames: int,
    fps: float,
    options: ImportOptions,
    found: list[tuple[str, str]],
    told: list[str],
) -> list[_Boxes | None]:
    """Boxes in pixels, those of a known layout as left, top, width, height."""
    pieces = [camera.detections for camera in cameras]
    firsts = {_first_index(p, options, frames) for p in pieces if p is not None}
    # all cameras were written by the same program: one that begins at 0 speaks for all
    first = min(firsts, default=0)
    if first and any(p is not None and p.first_index is None for p in pieces):
        found.append(("first index", "1, since no frame is called 0; --first-index"))
    result: list[_Boxes | None] = []
    for camera, size in zip(cameras, sizes, strict=True):
        piece = camera.detections
        if piece is None:
            result.append(None)
            continue
        layout = options.boxes or piece.layout
        scale = size if piece.normalised else None
        four = read_boxes(piece.boxes, layout or "ltwh", scale)
        steps = piece.frames - first
        video = camera.video
        within = frames if own_rate(video, fps) is None or video is None else video.frames
        there = (steps >= 0) & (steps < within)
        if not there.all():
            told.append(
                f"{piece.source.name}: {int((~there).sum())} of {len(there)} boxes are of frames "
                f"outside the {within} of the pictures; --first-index says where counting begins"
            )
        scores = np.clip(piece.scores, 0.0, 1.0)
        own = Detections(steps[there], four[there], scores[there])
        result.append((own, layout))
    return result


def _read(
    raws: list[RawCamera],
    boxes: list[_Boxes | None],
    ratios: Sequence[float],
    arbitrary: bool,
    found: list[tuple[str, str]],
) -> tuple[Reading, list[RawCamera], list[_Boxes | None]]:
    """How poses and boxes are meant: by flags, formats, the boxes and the poses, in this order."""
    seen = [
        None if own is None else Seen(_steps(own[0].frames, ratio), own[0].boxes)
        for own, ratio in zip(boxes, ratios, strict=True)
    ]
    unknown = any(own is not None and own[1] is None for own in boxes)
    layouts: tuple[Layout, ...] = ("ltwh", "xyxy") if unknown else ("ltwh",)
    convention = raws[0].convention
    meaning = find_meaning(
        raws,
        seen,
        tried=Open(layouts=layouts, normalised=(False,), orders=False),
        unit=convention.unit,
        up=convention.up,
    )
    enough = meaning is not None and meaning.best.consensus.agreeing >= 20
    if meaning is None or not enough:
        reading = read_poses(raws)
        why = "from where the cameras look; the boxes do not tell"
    else:
        reading = meaning.reading
        share = 100.0 * meaning.best.consensus.share
        why = f"since {share:.0f} % of the boxes meet so"
        if unknown:
            found.append(("boxes", f"{reading.layout}, {why}; --boxes"))
    for name, known, flag in (
        ("direction", convention.direction, "pose"),
        ("axes", convention.axes, "axes"),
        ("up", convention.up, "up"),
        ("unit", convention.unit, "unit"),
    ):
        if known is None:
            how = "by the height of people" if name == "unit" and enough else why
            found.append((name, f"{getattr(reading, name)}, {how}; --{flag}"))
    changed: list[_Boxes | None] = []
    for own in boxes:
        if own is not None and own[1] is None:
            four = read_boxes(own[0].boxes, reading.layout)
            own = (replace(own[0], boxes=four), reading.layout)
        changed.append(own)
    if meaning is not None and enough and arbitrary and convention.unit is None:
        factor = PERSON / meaning.height
        raws = [_resized(raw, factor) for raw in raws]
        found.append(("unit", f"scaled by {factor:.4g}, so that people are {PERSON} m; --unit"))
    return replace(reading, layout="ltwh", order=None), raws, changed


def _detections(own: _Boxes | None) -> Detections | None:
    """Sorted by step, without boxes that have no size."""
    if own is None:
        return None
    boxes = own[0]
    order = np.argsort(boxes.frames, kind="stable")
    order = order[(boxes.boxes[order, 2:] > 0.0).all(axis=1)]
    return Detections(boxes.frames[order], boxes.boxes[order], boxes.scores[order])


def _room(
    cameras: Sequence[Camera],
    detections: Sequence[Detections | None],
    found: list[tuple[str, str]],
) -> Suggestion:
    """Where people are, and how large they are: from the boxes, else from the views."""
    agreed = None
    if any(own is not None for own in detections):
        nothing = Detections(np.zeros(0, dtype=np.int64), np.zeros((0, 4)), np.zeros(0))
        rays = [
            rays_of((own or nothing).frames, (own or nothing).boxes, camera)
            for camera, own in zip(cameras, detections, strict=True)
        ]
        agreed = agreement(cameras, rays)
    room = suggest(cameras, agreed)
    if room is None:
        centres = np.array([camera.centre for camera in cameras])
        low, high = centres.min(axis=0) - 3.0, centres.max(axis=0) + 3.0
        room = Suggestion(
            np.array([low[0], low[1], 0.0]), np.array([high[0], high[1], 2.0]), STANDING, 0.0, 0
        )
        found.append(("room", "around the cameras: neither boxes nor views meet; correct it"))
        return room
    margin = np.array([ROOM_MARGIN, ROOM_MARGIN, 0.0])
    room = replace(room, minimum=room.minimum - margin, maximum=room.maximum + margin)
    how = f"from {room.people} pairs of boxes that meet" if room.people else "where views overlap"
    sides = " × ".join(f"{side:.1f}" for side in _sides(room))
    found.append(("room", f"{sides} m, {how}"))
    size = " × ".join(f"{2.0 * side:.2f}" for side in room.half_extents)
    found.append(
        ("target", f"{size} m, {'from the boxes' if room.people else 'a standing person'}")
    )
    return room


def _sides(room: Suggestion) -> Float[ndarray, " 3"]:
    return np.asarray(room.maximum - room.minimum)
