"""From matched files to what a sequence needs: conventions, sizes, rate, room and target."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import NamedTuple, get_args

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.geometry.camera import Camera
from tracker.geometry.consistency.suggestion import (
    STANDING,
    Suggestion,
    consensus_of_cameras,
    suggest,
)
from tracker.io.conventions.judge import Open, Seen, compared
from tracker.io.conventions.level import lean_of
from tracker.io.conventions.orders import MOST_CAMERAS
from tracker.io.conventions.questions import (
    ACCEPT,
    OF_ONE,
    OF_TWO,
    PARTS,
    UNPROVEN,
    Undecided,
    Unexplained,
    check_verdict,
    describe_clocks,
    describe_moved,
    describe_unconfirmed,
    rearranged,
)
from tracker.io.conventions.reading import Reading, read_boxes, to_camera
from tracker.io.conventions.search import ClockFit, Verdict, as_meant, find_reading
from tracker.io.importing.arriving import short_videos
from tracker.io.importing.finding.angles import check_turns, chosen_turns, turns_in_words
from tracker.io.importing.finding.calibrations import camera_sets
from tracker.io.importing.finding.geometry import check_lenses, check_places, read_poses
from tracker.io.importing.finding.matching import (
    Matched,
    MatchedCamera,
    first_of,
    match_all,
    matched_by,
    nothing_of,
    same_aspect,
)
from tracker.io.importing.finding.people import rate_of, rays_of_all
from tracker.io.importing.finding.pictures import (
    COMMON_SIZES,
    exchange_by_shape,
    picture_sizes,
    scaled,
)
from tracker.io.importing.finding.scale import AS_STANDING, PERSON, paced, resized
from tracker.io.importing.finding.times import (
    CameraTime,
    Times,
    check_common,
    counted_alike,
    first_index,
    frames_of,
    settle_times,
    told_beyond,
)
from tracker.io.importing.finding.truths import in_gaps, settle_truth
from tracker.io.importing.gathering import ParsedFiles
from tracker.io.importing.options import ImportOptions
from tracker.io.read.pieces import FormatError, Layout, RawCamera
from tracker.sequences.sequence import Detections, Entrance, GroundTruth
from tracker.sequences.tables import regular_gap

ROOM_MARGIN = 1.0
"""Metres on each side: a room that is too large costs little, who is outside is lost."""

FARTHEST = 1e6
"""Pixels from a picture's corner: a box that lies farther is no one's."""

_ALONG_AXIS = 0.9999
"""Cosine from which people stand along an axis of the world."""

_WITHOUT_UNIT = ("COLMAP", "nerfstudio", "Metashape", "OpenMVG", "MVSNet", "Middlebury")
"""Formats whose unit is arbitrary."""


@dataclass(frozen=True, slots=True, eq=False)
class PlannedView:
    """One camera, ready to be written."""

    camera: Camera
    matched: MatchedCamera
    detections: Detections | None
    """By frames of the camera's own file."""
    time: CameraTime
    looked_at: Int[ndarray, " K"] | None = None
    """Frames of the file at which the detector ran; None where it ran at all."""


@dataclass(frozen=True, slots=True, eq=False)
class ImportPlan:
    """A recording, ready to be written, and what was found out on the way."""

    views: tuple[PlannedView, ...]
    fps: float
    frames: int
    room: Suggestion
    """As it is written."""
    suggested: Suggestion
    """As it was found out."""
    entrances: tuple[Entrance, ...]
    """Of the room; none unless they are wished."""
    truth: GroundTruth | None
    calibration: str
    """What its file was recognised as."""
    reading: Reading
    found: tuple[tuple[str, str], ...]
    """What was not in the files or had to be chosen, and why it is so."""
    told: tuple[str, ...]
    """Sentences about what is not used or odd."""
    sources: frozenset[Path]
    """The files that it is made of; of pictures, all."""
    open: Undecided | Unexplained | None = None
    """What is left open though the likeliest interpretation was accepted."""


def settle(taken: Sequence[ParsedFiles], options: ImportOptions | None = None) -> ImportPlan:
    """Find out everything that a sequence needs.

    Raises:
        FormatError: If there is no calibration, or files contradict each other; the sentence
            says which and what to do.
        Undecided, Unexplained: If the boxes leave open how the files are meant, and the likeliest
            interpretation is not to be accepted.
    """
    options = options or ImportOptions()
    sets, told = camera_sets(taken)
    matched = match_all(taken, sets, options, told)
    told += matched.told + short_videos(taken)
    found: list[tuple[str, str]] = []
    if options.first_index is None:
        matched = counted_alike(matched, options.fps, found)
    cameras = matched.cameras
    for way in sorted({how for camera in cameras for how in camera.how.values()} - {"name"}):
        found.append(("matching", f"pictures and boxes go to the cameras by {way}"))
    exchange_by_shape(cameras, found)
    sizes = picture_sizes(cameras, found)
    check_lenses([camera.raw for camera in cameras + matched.spare], matched.format)
    plain = [scaled(camera.raw, size) for camera, size in zip(cameras, sizes, strict=True)]
    raws = [_told(raw, options) for raw in plain]
    unused = _spare(matched)
    spare = [_told(camera.raw, options) for camera in unused]
    if not any(c.video or c.images or c.detections is not None for c in cameras):
        raise nothing_of(cameras, taken, told)
    times = settle_times(cameras, matched.truths, options, found)
    boxes = _boxes(cameras, sizes, times, options, found, told)
    arbitrary = matched.format.startswith(_WITHOUT_UNIT)
    open_: list[Undecided | Unexplained] = []
    reading, raws, boxes, factor, verdict = _read(
        raws, plain, spare, cameras, boxes, times, arbitrary, options, found, told, open_
    )
    names = [raw.name for raw in raws]
    _exchange_found([*cameras, *unused], verdict)
    late = {} if verdict is None else _late(verdict.clocks, names, options)
    if late:
        shifted = _shifted(options, late, times.fps)
        times = settle_times(cameras, matched.truths, shifted, [])
    sizes = [raw.image_size or size for raw, size in zip(raws, sizes, strict=True)]
    settled = [to_camera(raw, reading, size) for raw, size in zip(raws, sizes, strict=True)]
    check_places(settled, matched.format)
    detections = [_detections(own) for own in boxes]
    at_steps = _at_steps(detections, times)
    if factor is not None and options.half_extents is not None:
        height = 2.0 * options.half_extents[2]
        found.append(("unit", f"scaled by {factor:.4g}, so that people are {height:g} m; --unit"))
    elif factor is not None:
        more, why = paced(settled, at_steps, times.fps) if times.stated else (1.0, AS_STANDING)
        settled = resized(settled, more)
        found.append(("unit", f"scaled by {more * factor:.4g}, {why}: --unit"))
    if not times.stated:
        fps, why = rate_of(settled, at_steps)
        found.append(("fps", f"{fps:g}, {why}, since no file says it; --fps"))
        if verdict is not None:
            verdict = verdict.at_rate(fps)
            late = _late(verdict.clocks, names, options)
        shifted = _shifted(options, late, fps).model_copy(update={"fps": fps})
        times = settle_times(cameras, matched.truths, shifted, [])
        at_steps = _at_steps(detections, times)
    if verdict is not None:
        unconfirmed = describe_unconfirmed(verdict, names, times.fps)
        told += filter(None, (unconfirmed.alone, unconfirmed.others))
        told += describe_clocks(verdict.clocks, names, times.fps)
    for name, steps in late.items():
        how = f"{steps / times.fps:.2f} s late ({steps} steps, within 1)"
        found.append((f"{name} clock", f"{how}, since boxes meet so"))
    looked_at = _looked_at(detections, [camera.name for camera in settled], found)
    suggested = _room(settled, at_steps, found)
    room = _as_told(suggested, options)
    truth = settle_truth(
        [piece for _, piece in matched.truths],
        settled,
        at_steps,
        [None if c.detections is None else c.detections.camera for c in cameras],
        reading,
        times.frames,
        room.floor,
        float(room.half_extents[2]) + room.floor,
        options.first_index,
        found,
    )
    named = _renamed(settled, options, found)
    views = tuple(
        PlannedView(camera, own, boxes_, time, at)
        for camera, own, boxes_, time, at in zip(
            named, cameras, detections, times.cameras, looked_at, strict=True
        )
    )
    return ImportPlan(
        views,
        times.fps,
        times.frames,
        room,
        suggested,
        _entrances(options),
        truth,
        matched.format,
        reading,
        tuple(found),
        tuple(_summed_up(told)),
        _sources(matched),
        open_[0] if open_ else None,
    )


def _summed_up(told: Sequence[str]) -> list[str]:
    """Sentences, those that say the same of several files or cameras as one."""
    names: dict[str, list[str]] = {}
    for sentence in told:
        name, colon, words = sentence.partition(": ")
        names.setdefault(words if colon else sentence, []).extend([name] if colon else [])
    return [f"{first_of(own)}: {words}" if own else words for words, own in names.items()]


def _sources(matched: Matched) -> frozenset[Path]:
    """The files of a recording."""
    found = {piece.source for _, piece in matched.truths}
    for camera in matched.cameras:
        found |= {camera.video.path} if camera.video is not None else set()
        found |= set(camera.images.files) if camera.images is not None else set()
        found |= {piece.source for piece in (camera.detections, camera.times) if piece is not None}
    return matched.sources | found


def _exchange_found(cameras: Sequence[MatchedCamera], verdict: Verdict | None) -> None:
    """Note whose calibration each camera has by the boxes.

    Args:
        cameras: Those that were judged, in their order.
        verdict: What the boxes tell, where they tell anything.
    """
    order = None if verdict is None else verdict.best.reading.order
    if order is not None:
        owners = [camera.calibration_of for camera in cameras]
        for camera, own in zip(cameras, order, strict=True):
            camera.calibration_of = owners[own]


def _spare(matched: Matched) -> list[MatchedCamera]:
    """Calibrations without files that may be those of boxes which no name gave to a camera."""
    known = [camera for camera in matched.spare if camera.raw.image_size is not None]
    few = len(matched.cameras) + len(known) <= MOST_CAMERAS
    return known if few and matched_by(matched.cameras) != "name" else []


def _late(
    clocks: Mapping[int, ClockFit], names: Sequence[str], options: ImportOptions
) -> dict[str, int]:
    """Steps by which cameras are late; what is stated is not questioned."""
    return {
        names[camera]: clock.late
        for camera, clock in clocks.items()
        if clock.late and names[camera] not in options.offsets
    }


def _shifted(options: ImportOptions, late: Mapping[str, int], fps: float) -> ImportOptions:
    """With the offsets of cameras that are late by so many steps; what is stated is kept."""
    found = {name: -steps / fps for name, steps in late.items() if name not in options.offsets}
    return options.model_copy(update={"offsets": {**found, **options.offsets}})


def _looked_at(
    detections: Sequence[Detections | None], names: Sequence[str], found: list[tuple[str, str]]
) -> list[Int[ndarray, " K"] | None]:
    """The frames at which detectors ran, where these are every second, third … one."""
    result: list[Int[ndarray, " K"] | None] = []
    gaps: dict[int, list[str]] = {}
    every_camera = [own.frames for own in detections if own is not None]
    for name, own in zip(names, detections, strict=True):
        others = [frames for frames in every_camera if own is None or frames is not own.frames]
        gap = 1 if own is None else regular_gap(own.frames, *others)
        first, last = (0, 0) if own is None or gap == 1 else (own.frames[0], own.frames[-1])
        result.append(None if gap == 1 else np.arange(first % gap, last + 1, gap))
        if gap > 1:
            gaps.setdefault(gap, []).append(name)
    for gap, own_names in gaps.items():
        every = in_gaps(gap)
        found.append(
            ("detector", f"ran at {every} of {', '.join(own_names)}; others were not looked at")
        )
    return result


def _at_steps(detections: Sequence[Detections | None], times: Times) -> list[Detections | None]:
    return [
        None if own is None else at_steps_of(own, time)
        for own, time in zip(detections, times.cameras, strict=True)
    ]


def at_steps_of(own: Detections, time: CameraTime) -> Detections:
    """Boxes by step in place of the file's frames, without those of frames that no step shows."""
    if time.clock is None:
        return own
    steps = time.steps_of(own.frames)
    rows = np.flatnonzero(steps >= 0)
    rows = rows[np.argsort(steps[rows], kind="stable")]
    return Detections(steps[rows], own.boxes[rows], own.scores[rows])


def plain_name(name: str) -> str:
    """A name without what heads no CSV column."""
    return re.sub(r'[,"#\s]+', "_", name).strip("_") or "camera"


def _renamed(
    cameras: Sequence[Camera], options: ImportOptions, found: list[tuple[str, str]]
) -> list[Camera]:
    """Cameras under the names that are wished, and that can be written."""
    renamed: list[Camera] = []
    for camera in cameras:
        wished = options.names.get(camera.name, camera.name).strip()
        name = plain_name(wished) if wished else ""
        if name != wished and camera.name in options.names:
            raise FormatError(
                f"name of {camera.name}: expected one without blanks, commas, quotes and #, since "
                f'it heads columns of tables, found "{wished}"; "{name}" would do'
            )
        if name != wished:
            found.append(("name", f'"{camera.name}" is called {name}: names head columns of CSV'))
        renamed.append(replace(camera, name=name))
    names = [camera.name for camera in renamed]
    for name in names:
        if not name or names.count(name) > 1:
            raise FormatError(
                f'expected a name of its own for each camera, found "{name}"'
                f"{' twice' if name else ''}; choose another"
            )
    return renamed


def _as_told(room: Suggestion, options: ImportOptions) -> Suggestion:
    """The room and the size of people as they are stated."""
    if options.half_extents is not None:
        room = replace(room, half_extents=np.array(options.half_extents))
    if options.room is None:
        return room
    minimum, maximum = (np.array(corner) for corner in options.room)
    for axis, low, high in zip("xyz", minimum, maximum, strict=True):
        if not low < high:
            raise FormatError(
                f"room: expected {axis} to end above {low:g} m, where it begins, found {high:g} m"
            )
    return replace(room, minimum=minimum, maximum=maximum)


def _entrances(options: ImportOptions) -> tuple[Entrance, ...]:
    """Those that are wished."""
    for position, sigma in options.entrances:
        if not (np.isfinite(position).all() and np.isfinite(sigma).all() and min(sigma) > 0.0):
            raise FormatError(
                "entrances: expected x, y, z and three positive standard deviations in metres, "
                f"found {position} and {sigma}"
            )
    return tuple(Entrance(np.array(place), np.array(sigma)) for place, sigma in options.entrances)


def _told(raw: RawCamera, options: ImportOptions) -> RawCamera:
    """With what the flags say in place of what the format says."""
    convention = replace(
        raw.convention,
        direction=options.pose or raw.convention.direction,
        axes=options.axes or raw.convention.axes,
        up=options.up or raw.convention.up,
    )
    if options.turns is not None and raw.turns:
        raw = replace(raw, turns=chosen_turns(raw, options.turns))
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


class _Boxes(NamedTuple):
    """The boxes of one camera."""

    detections: Detections
    """In pixels, and left, top, width, height if the layout is known; else as in the file."""
    layout: Layout | None
    scale: tuple[int, int] | None = None
    """The picture's size, pixels, where numbers of an unknown layout are parts of it."""


_MOST_OUTSIDE = 0.5
"""Share of all boxes that may be of frames which the recording does not have."""


def _boxes(
    cameras: Sequence[MatchedCamera],
    sizes: Sequence[tuple[int, int]],
    times: Times,
    options: ImportOptions,
    found: list[tuple[str, str]],
    told: list[str],
) -> list[_Boxes | None]:
    """Boxes in pixels, those of a known layout as left, top, width, height."""
    pieces = [camera.detections for camera in cameras]
    firsts = {first_index(p, options, times.frames) for p in pieces if p is not None}
    # all cameras were written by the same program: one that begins at 0 speaks for all
    first = min(firsts, default=0)
    if first and any(p is not None and p.first_index is None for p in pieces):
        found.append(("first index", "1, since no frame is called 0; --first-index"))
    result: list[_Boxes | None] = []
    outside, rows, example = 0, 0, ""
    for camera, size, time in zip(cameras, sizes, times.cameras, strict=True):
        piece = camera.detections
        if piece is None:
            result.append(None)
            continue
        layout = options.boxes or piece.layout
        normalised = piece.normalised if options.normalised is None else options.normalised
        scale = size if normalised else None
        four = piece.boxes if layout is None else read_boxes(piece.boxes, layout, scale)
        steps = piece.frames - first
        within = frames_of(camera, time, times.frames)
        there = (steps >= 0) & (steps < within)
        sane = (np.abs(four) < FARTHEST).all(axis=1)
        if not sane.all():
            told.append(
                f"{piece.source.name}: {int((~sane).sum())} of {len(sane)} boxes lie farther than "
                f"{FARTHEST:,.0f} pixels away; they are left out"
            )
        if piece.left_out:
            told.append(piece.left_out)
        if beyond := told_beyond(piece, first, within):
            told.append(beyond)
            example = beyond
        scores = np.clip(piece.scores, 0.0, 1.0)
        outside += int((~there).sum())
        rows += len(there)
        there &= sane
        own = Detections(steps[there], four[there], scores[there])
        result.append(_Boxes(own, layout, scale if layout is None else None))
    if outside > _MOST_OUTSIDE * rows and not options.accept_best:
        raise FormatError(
            f"{outside} of {rows} boxes are of frames outside the {times.frames} of the recording "
            f"({example}); name boxes and pictures of the same frames, or {ACCEPT} imports the "
            "others alone"
        )
    return result


def _read(
    raws: list[RawCamera],
    plain: Sequence[RawCamera],
    spare: Sequence[RawCamera],
    cameras: Sequence[MatchedCamera],
    boxes: list[_Boxes | None],
    times: Times,
    arbitrary: bool,
    options: ImportOptions,
    found: list[tuple[str, str]],
    told: list[str],
    open_: list[Undecided | Unexplained],
) -> tuple[Reading, list[RawCamera], list[_Boxes | None], float | None, Verdict | None]:
    """How poses and boxes are meant: by flags, formats, the boxes and the poses, in this order.

    Returns:
        The reading; cameras and boxes as they are by it; by how much the cameras' unit was made
        larger so that people are as tall as they are said to be, or as people who stand; and what
        the boxes tell, where they tell anything.
    """
    seen = [
        None if own is None else _seen(own.detections, time)
        for own, time in zip(boxes, times.cameras, strict=True)
    ]
    open_boxes = [own for own in boxes if own is not None and own.layout is None]
    in_parts = {own.scale is not None for own in open_boxes if len(own.detections.frames)}
    if len(in_parts) > 1:
        raise FormatError(
            "some cameras' boxes are pixels and others parts of the picture, and how their numbers "
            "are meant is not said: --boxes says it"
        )
    layouts: tuple[Layout, ...] = get_args(Layout) if open_boxes else ("ltwh",)
    convention = raws[0].convention
    free = not options.swap and not options.cameras and not options.as_named
    find = partial(
        find_reading,
        seen=[*seen, *[None] * len(spare)],
        fps=times.fps,
        tried=Open(layouts=layouts, parts=(int(True in in_parts),), orders=free),
        names=matched_by(cameras),
        pixels=_other_pixels(cameras, raws, seen),
    )
    verdict = find([*raws, *spare])
    question = None
    if verdict is not None:
        stated = _stated(options) if verdict.kind == "none" else ""
        otherwise = find([*plain, *spare]) if stated else None
        if otherwise is not None and otherwise.kind not in ("decided", "open"):
            otherwise = None
        question = check_verdict(verdict, [*raws, *spare], stated, otherwise)
    if not options.accept_best:
        if question is not None or verdict is None or verdict.kind == "unproven":
            pairs = zip(raws, seen, strict=True)
            check_common({raw.name: own.frames for raw, own in pairs if own is not None})
        if question is not None:
            raise question
    elif question is not None:
        open_.append(question)
        found.append(("accepted", f"by {ACCEPT}: {question}"))
    if sum(own is not None for own in seen) == 1:
        told.append(OF_ONE)
    larger = 1.0
    enough = verdict is not None and verdict.kind in ("decided", "open")
    if verdict is None or not enough:
        check_turns(raws)
        reading = read_poses(raws, boxes=any(own is not None for own in boxes))
        why = "from where the cameras look; the boxes do not tell"
        best = None
        if verdict is not None and verdict.kind == "unproven":
            told.append(UNPROVEN)
    else:
        best, reading = as_meant(verdict, convention.up, convention.up, convention.unit)
        reading = replace(reading, flipped=False)
        # boxes lean in rolled cameras; where people along an axis are likelier, the world is level
        rise = verdict.best.scene.rise
        along = float(np.abs(rise).max() / np.linalg.norm(rise))
        if convention.up is None and along < _ALONG_AXIS:
            poses = verdict.judge.poses(reading)
            lean = lean_of(best.consensus, best.pictured, poses, best.turns, reading.up)
            reading = replace(reading, lean=lean)
        share = 100.0 * best.consensus.share
        why = f"since {share:.0f} % of the boxes meet so"
        if open_boxes:
            found.append(("boxes", f"{reading.layout}, {why}; --boxes"))
        if any(camera.picture_size is not None for camera in cameras):
            larger, reading = reading.pixels, replace(reading, pixels=1.0)
            if larger != 1.0:
                how = f"of pictures {larger:.4g} times as wide, as the calibration's"
                found.append(("boxes", f"{how}, {why}"))
        every, told_ = rearranged([*raws, *spare], reading)
        raws = every[: len(raws)]
        found += told_
        if len(verdict.confirmed) == 2 and verdict.kind == "decided":
            told.append(OF_TWO)
        told += describe_moved(verdict.moved, [raw.name for raw in raws])
    if any(raw.turns for raw in raws):
        found.append(("angles", f"{turns_in_words(reading.turns)}, {why}; --euler"))
    if reading.lean != (0.0, 0.0):
        degrees = np.degrees(np.arcsin(np.hypot(*reading.lean)))
        found.append(("level", f"the world is turned by {degrees:.0f}° so that people stand"))
    for name, known, flag in (
        ("direction", convention.direction, "pose"),
        ("axes", convention.axes, "axes"),
        ("up", convention.up, "up"),
        ("unit", convention.unit, "unit"),
    ):
        if known is None and not (name == "unit" and enough and arbitrary):
            how = "by the height of people" if name == "unit" and enough else why
            found.append((name, f"{getattr(reading, name)}, {how}; --{flag}"))
    factor: float | None = None
    changed: list[_Boxes | None] = []
    finer = reading.parts if reading.parts > 1 else 0
    if finer:
        found.append(("boxes", f"{PARTS[finer]}, {why}"))
    for own, raw in zip(boxes, raws, strict=True):
        if own is not None and (own.layout is None or finer):
            scale = raw.image_size if finer else own.scale
            layout = reading.layout if own.layout is None else "ltwh"
            four = read_boxes(own.detections.boxes, layout, scale, max(finer, 1))
            own = _Boxes(replace(own.detections, boxes=four), reading.layout)
        if own is not None and larger != 1.0:
            corners = (own.detections.boxes[:, :2] + 0.5) / larger - 0.5
            four = np.column_stack([corners, own.detections.boxes[:, 2:] / larger])
            own = own._replace(detections=replace(own.detections, boxes=four))
        changed.append(own)
    if best is not None and arbitrary and convention.unit is None:
        size = options.half_extents
        factor = (PERSON if size is None else 2.0 * size[2]) / best.consensus.height
        raws = [_resized(raw, factor) for raw in raws]
    reading = replace(reading, layout="ltwh", parts=0, order=None, pixels=1.0)
    return reading, raws, changed, factor, verdict if enough else None


def _stated(options: ImportOptions) -> str:
    """The flags that state how poses are meant."""
    flags = (("pose", options.pose), ("axes", options.axes), ("euler", options.turns))
    return " ".join(f"--{name} {value}" for name, value in flags if value is not None)


def _other_pixels(
    cameras: Sequence[MatchedCamera], raws: Sequence[RawCamera], seen: Sequence[Seen | None]
) -> tuple[float, ...]:
    """Widths of pictures that the boxes may be of, in that which is known or taken."""
    if all(camera.picture_size is None for camera in cameras):
        return _pixels(raws, seen)
    # pictures may be smaller than those that were calibrated and detected in
    ratios = {
        camera.raw.image_size[0] / camera.picture_size[0]
        for camera in cameras
        if camera.picture_size is not None and camera.raw.image_size is not None
    }
    return tuple(ratios - {1.0}) if len(ratios) == 1 else ()


def _pixels(raws: Sequence[RawCamera], seen: Sequence[Seen | None]) -> tuple[float, ...]:
    """Widths of pictures that the boxes may be of, in that of the calibration's."""
    first = raws[0].image_size
    if first is None:
        return (0.5, 2.0)
    begins = [
        np.quantile(own.four[:, 0], 0.99) for own in seen if own is not None and len(own.four)
    ]
    least = float(max(begins, default=0.0))
    known = [
        size[0] / first[0]
        for size in COMMON_SIZES
        if same_aspect(size, first) and least <= size[0] <= 4.0 * least
    ]
    # what differs by a few per cent leads to the same scene
    return tuple(dict.fromkeys(round(own, 6) for own in (0.5, 2.0, *known) if abs(own - 1) > 0.05))


def _seen(own: Detections, time: CameraTime) -> Seen:
    steps = time.steps_of(own.frames)
    kept = (steps >= 0) & compared(own.scores)
    return Seen(steps[kept], own.boxes[kept])


def _detections(own: _Boxes | None) -> Detections | None:
    """Sorted by step, without boxes that have no size."""
    if own is None:
        return None
    boxes = own.detections
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
        agreed = consensus_of_cameras(cameras, rays_of_all(cameras, detections))
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
