"""From matched files to what a sequence needs: conventions, sizes, rate, room and target."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import NamedTuple, get_args

import numpy as np
from jaxtyping import Bool, Float, Int
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
from tracker.io.conventions.search import Verdict, as_meant, find_reading
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
from tracker.io.importing.finding.names import short_names
from tracker.io.importing.finding.people import (
    AS_STANDING,
    PERSON,
    paced,
    rate_of,
    rays_of_all,
    resized,
)
from tracker.io.importing.finding.pictures import (
    COMMON_SIZES,
    exchange_by_shape,
    picture_sizes,
    scaled,
)
from tracker.io.importing.finding.times import (
    CameraTime,
    check_common,
    counted_alike,
    first_index,
    frames_of,
    settle_times,
    told_beyond,
)
from tracker.io.importing.finding.truths import Surroundings, in_gaps, settle_truth
from tracker.io.importing.gathering import ParsedFiles
from tracker.io.importing.options import ImportOptions
from tracker.io.read.pieces import DetectionPiece, FormatError, Layout, RawCamera
from tracker.sequences.fields import listed
from tracker.sequences.sequence import Detections, Entrance, GroundTruth
from tracker.sequences.tables import regular_gap

ROOM_MARGIN = 1.0
"""Metres on each side: a room that is too large costs little, who is outside is lost. From 0.5 to 2
recall changes by 0.0003 in the mean of eight random rooms and two recordings, false positives by
0.001; without it recall is 0.001 less and false positives are 0.004 fewer."""

FARTHEST = 1e6
"""Pixels from a picture's corner: a box that lies farther is no one's."""

_ALONG_AXIS = 0.9999
"""Cosine from which people stand along an axis of the world."""

_MOST_OUTSIDE = 0.5
"""Share of all boxes that may be of frames which the recording does not have."""

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
    draft = _PlanDraft(taken, options or ImportOptions())
    verdict = draft.judge()
    meaning = draft.read_poses() if verdict is None else draft.read_boxes(verdict)
    draft.adopt(meaning)
    if verdict is not None:
        draft.set_clocks(verdict)
    cameras = draft.place_cameras(meaning)
    if not draft.times.stated:
        verdict = draft.find_rate(cameras, verdict)
    draft.describe_clocks(verdict)
    return draft.plan(cameras, meaning.of_poses)


class _Boxes(NamedTuple):
    """The boxes of one camera."""

    detections: Detections
    """In pixels, and left, top, width, height if the layout is known; else as in the file."""
    layout: Layout | None
    scale: tuple[int, int] | None = None
    """The picture's size, pixels, where numbers of an unknown layout are parts of it."""


class _Meaning(NamedTuple):
    """How calibration and boxes are meant."""

    reading: Reading
    why: str
    """By what it is known, in words."""
    height: float | None = None
    """The height of people, in the calibration's unit; None where the boxes do not tell."""
    wider: float = 1.0
    """Width of the pictures that the boxes are of, in that of the pictures that there are."""

    @property
    def of_poses(self) -> Reading:
        """The reading once it is applied to the boxes and to whose calibration is whose."""
        return replace(self.reading, layout="ltwh", parts=0, order=None, pixels=1.0)


class _PlanDraft:
    """An import that is being settled: the matched files, and what is known of them so far."""

    def __init__(self, taken: Sequence[ParsedFiles], options: ImportOptions) -> None:
        """Match the files, and read what needs no comparison of the cameras' boxes.

        Args:
            taken: All files.
            options: What is stated.
        """
        sets, self.sentences = camera_sets(taken)
        """What is not used or odd."""
        self.notes: list[tuple[str, str]] = []
        """What was not in the files or had to be chosen, and why it is so."""
        self.accepted: Undecided | Unexplained | None = None
        """What is left open though the likeliest interpretation was accepted."""
        self.options = options
        matched = match_all(taken, sets, options, self.sentences)
        self.sentences += matched.told + short_videos(taken)
        if options.first_index is None:
            matched = counted_alike(matched, options.fps, self.notes)
        self.matched = matched
        """The files by camera."""
        for way in sorted({how for own in matched.cameras for how in own.how.values()} - {"name"}):
            pairs = [(c.raw.name, str(file)) for c in matched.cameras for file in c.files_by(way)]
            times = Counter(file for _, file in pairs)
            within = [name for name, file in pairs if times[file] > 1]
            if within:
                told = f"the parts of a file of several cameras go to {listed(within)} by {way}"
                self._note("matching", told)
            pairs = [pair for pair in pairs if times[pair[1]] == 1]
            files = short_names([file for _, file in pairs])
            told = ", ".join(f"{pair[0]} = {file}" for pair, file in zip(pairs, files, strict=True))
            if told:
                self._note("matching", f"files go to cameras by {way}: {told}; --camera NAME=FILE")
        exchange_by_shape(matched.cameras, self.notes)
        self.sizes = picture_sizes(matched.cameras, self.notes)
        """The size of each camera's pictures, pixels."""
        check_lenses([camera.raw for camera in matched.cameras + matched.spare], matched.format)
        self.given = [
            scaled(camera.raw, size)
            for camera, size in zip(matched.cameras, self.sizes, strict=True)
        ]
        """Each camera's calibration for these pictures, as its file states it."""
        self.raws = [_with_stated(raw, options) for raw in self.given]
        """The same with what the options state in its place."""
        self.convention = self.raws[0].convention
        """What is stated of the poses."""
        self.unused = _unused(matched)
        """Cameras without files, whose calibration may be that of another one's boxes."""
        self.spare = [_with_stated(camera.raw, options) for camera in self.unused]
        """The calibrations of these."""
        if not any(c.video or c.images or c.detections is not None for c in matched.cameras):
            raise nothing_of(matched.cameras, taken, self.sentences)
        self.times = settle_times(matched.cameras, matched.truths, options, self.notes)
        self.late: dict[str, int] = {}
        """Steps by which cameras are late, by their names."""
        self.boxes = self._boxes_in_pixels()
        """The boxes of each camera, None where it has none."""

    def _note(self, what: str, why: str) -> None:
        """Note what was chosen, and why it is so."""
        self.notes.append((what, why))

    @property
    def names(self) -> list[str]:
        """What the cameras are called in the calibration."""
        return [raw.name for raw in self.raws]

    @property
    def detections(self) -> list[Detections | None]:
        """The boxes of each camera, by frames of its own file."""
        return [None if own is None else own.detections for own in self.boxes]

    @property
    def at_steps(self) -> list[Detections | None]:
        """The boxes of each camera, by step."""
        return [
            None if own is None else at_steps_of(own, time)
            for own, time in zip(self.detections, self.times.cameras, strict=True)
        ]

    @property
    def _unit_is_arbitrary(self) -> bool:
        """Whether the calibration has a unit of its own, and none is stated."""
        return self.convention.unit is None and self.matched.format.startswith(_WITHOUT_UNIT)

    # the boxes as their files have them

    @property
    def _named(self) -> Layout | None:
        """The layout that the files of all cameras name for boxes in pixels, which is not stated.

        A header may name another one than its columns hold: the boxes tell.
        """
        pieces = [camera.detections for camera in self.matched.cameras if camera.detections]
        named = {piece.layout for piece in pieces}
        stated = self.options.normalised
        in_parts = any(piece.normalised if stated is None else stated for piece in pieces)
        alike = len(named) == 1 and not in_parts and self.options.boxes is None
        return named.pop() if alike else None

    def _boxes_in_pixels(self) -> list[_Boxes | None]:
        """Read the boxes, those of a layout that is not in question as left, top, width, height."""
        first = self._first_index()
        boxes: list[_Boxes | None] = []
        outside, rows, example = 0, 0, ""
        for camera, size, time in zip(
            self.matched.cameras, self.sizes, self.times.cameras, strict=True
        ):
            piece = camera.detections
            if piece is None:
                boxes.append(None)
                continue
            within = frames_of(camera, time, self.times.frames)
            there = (piece.frames >= first) & (piece.frames < first + within)
            boxes.append(self._in_pixels(piece, size, first, there))
            if piece.left_out:
                self.sentences.append(piece.left_out)
            if beyond := told_beyond(piece, first, within):
                self.sentences.append(beyond)
                example = beyond
            outside += int((~there).sum())
            rows += len(there)
        if outside > _MOST_OUTSIDE * rows and not self.options.accept_best:
            raise FormatError(
                f"{outside} of {rows} boxes are of frames outside the {self.times.frames} of the "
                f"recording ({example}); name boxes and pictures of the same frames, or {ACCEPT} "
                "imports the others alone"
            )
        return boxes

    def _first_index(self) -> int:
        """Return the number of the first frame in the files of boxes."""
        pieces = [camera.detections for camera in self.matched.cameras if camera.detections]
        # all cameras were written by the same program: one that begins at 0 speaks for all
        first = min((first_index(p, self.options, self.times.frames) for p in pieces), default=0)
        if first and any(piece.first_index is None for piece in pieces):
            self._note("first index", "1, since no frame is called 0; --first-index")
        return first

    def _in_pixels(
        self,
        piece: DetectionPiece,
        size: tuple[int, int],
        first: int,
        there: Bool[ndarray, " N"],
    ) -> _Boxes:
        """Read the boxes of one camera, without those that lie far outside its pictures.

        Args:
            piece: The N boxes of the file.
            size: The size of the pictures, pixels.
            first: The number of the first frame.
            there: Whether the recording has a box's frame.
        """
        layout = self.options.boxes or (None if self._named else piece.layout)
        stated = self.options.normalised
        scale = size if (piece.normalised if stated is None else stated) else None
        four = piece.boxes if layout is None else read_boxes(piece.boxes, layout, scale)
        near = (np.abs(four) < FARTHEST).all(axis=1)
        if not near.all():
            self.sentences.append(
                f"{piece.source.name}: {int((~near).sum())} of {len(near)} boxes lie farther than "
                f"{FARTHEST:,.0f} pixels away; they are left out"
            )
        rows = there & near
        scores = np.clip(piece.scores, 0.0, 1.0)
        own = Detections(piece.frames[rows] - first, four[rows], scores[rows])
        return _Boxes(own, layout, scale if layout is None else None)

    # how calibration and boxes are meant

    def judge(self) -> Verdict | None:
        """Return what the boxes tell of how the files are meant; None where they tell nothing.

        Raises:
            Undecided, Unexplained: If they leave it open, and nothing is to be accepted.
        """
        seen = self._seen()
        find = partial(
            find_reading,
            seen=[*seen, *[None] * len(self.spare)],
            fps=self.times.fps,
            tried=self._open(),
            names=matched_by(self.matched.cameras),
            pixels=_other_pixels(self.matched.cameras, self.raws, seen),
        )
        verdict = find([*self.raws, *self.spare])
        question = None
        if verdict is not None:
            unsure = verdict.kind in ("none", "open")
            stated = _stated_of_poses(self.options) if unsure else ""
            otherwise = find([*self.given, *self.spare]) if stated else None
            if otherwise is not None and not otherwise.outweighs(verdict):
                otherwise = None
            question = check_verdict(
                verdict, [*self.raws, *self.spare], stated, otherwise, self._named
            )
        if question is not None or verdict is None or verdict.kind == "unproven":
            self._accept(question, seen)
        if sum(own is not None for own in seen) == 1:
            self.sentences.append(OF_ONE)
        if verdict is not None and verdict.kind == "unproven":
            self.sentences.append(UNPROVEN)
        return None if verdict is None or verdict.kind in ("none", "unproven") else verdict

    def _seen(self) -> list[Seen | None]:
        """Return the boxes of each camera that are compared with those of the others."""
        return [
            None if own is None else _compared(own.detections, time)
            for own, time in zip(self.boxes, self.times.cameras, strict=True)
        ]

    def _open(self) -> Open:
        """Return what neither files nor options state."""
        unknown = [own for own in self.boxes if own is not None and own.layout is None]
        in_parts = {own.scale is not None for own in unknown if len(own.detections.frames)}
        if len(in_parts) > 1:
            raise FormatError(
                "some cameras' boxes are pixels and others parts of the picture, and how their "
                "numbers are meant is not said: --boxes says it"
            )
        layouts: tuple[Layout, ...] = get_args(Layout) if unknown else ("ltwh",)
        alternatives: tuple[Layout, ...] = ()
        if self._named:
            alternatives = tuple(layout for layout in layouts if layout != self._named)
            layouts = (self._named,)
        own = self.options
        orders = not own.swap and not own.cameras and not own.as_named
        return Open(
            layouts=layouts,
            alternatives=alternatives,
            parts=(int(True in in_parts),),
            orders=orders,
        )

    def _accept(
        self, question: Undecided | Unexplained | None, seen: Sequence[Seen | None]
    ) -> None:
        """Accept that the boxes decide nothing, or that they leave a question open.

        Raises:
            FormatError: If they are of different steps.
            Undecided, Unexplained: The question.
        """
        if not self.options.accept_best:
            pairs = zip(self.names, seen, strict=True)
            check_common({name: own.frames for name, own in pairs if own is not None})
            if question is not None:
                raise question
        elif question is not None:
            self.accepted = question
            self._note("accepted", f"by {ACCEPT}: {question}")

    def read_poses(self) -> _Meaning:
        """Return how the files are meant by where the cameras look."""
        check_turns(self.raws)
        reading = read_poses(self.raws, boxes=any(own is not None for own in self.boxes))
        reading = replace(reading, layout=self._named or reading.layout)
        return _Meaning(reading, "from where the cameras look; the boxes do not tell")

    def read_boxes(self, verdict: Verdict) -> _Meaning:
        """Return how the files are meant by the boxes, and give each camera its calibration."""
        up = self.convention.up
        best, reading = as_meant(verdict, up, up, self.convention.unit)
        reading = replace(reading, flipped=False)
        # boxes lean in rolled cameras; where people along an axis are likelier, the world is level
        rise = verdict.best.scene.rise
        along = float(np.abs(rise).max() / np.linalg.norm(rise))
        if up is None and along < _ALONG_AXIS:
            poses = verdict.judge.poses(reading)
            lean = lean_of(best.consensus, best.pictured, poses, best.turns, reading.up)
            reading = replace(reading, lean=lean)
        why = f"since {100.0 * best.consensus.share:.0f} % of the boxes meet so"
        in_question = any(own is not None and own.layout is None for own in self.boxes)
        if in_question and reading.layout != self._named:
            self._note("boxes", f"{reading.layout}, {why}; --boxes")
        wider = 1.0
        if any(camera.picture_size is not None for camera in self.matched.cameras):
            wider, reading = reading.pixels, replace(reading, pixels=1.0)
        if wider != 1.0:
            how = f"of pictures {wider:.4g} times as wide, as the calibration's"
            self._note("boxes", f"{how}, {why}")
        self._rearrange(reading, verdict.best.reading.order)
        if len(verdict.confirmed) == 2 and verdict.kind == "decided":
            self.sentences.append(OF_TWO)
        self.sentences += describe_moved(verdict.moved, self.names)
        return _Meaning(reading, why, best.consensus.height, wider)

    def _rearrange(self, reading: Reading, order: tuple[int, ...] | None) -> None:
        """Give each camera the calibration that is its own by the boxes.

        Args:
            reading: The reading.
            order: The camera whose calibration each camera has; None if they are as named.
        """
        every, notes = rearranged([*self.raws, *self.spare], reading)
        self.raws = every[: len(self.raws)]
        self.notes += notes
        if order is not None:
            cameras = [*self.matched.cameras, *self.unused]
            owners = [camera.calibration_of for camera in cameras]
            for camera, own in zip(cameras, order, strict=True):
                camera.calibration_of = owners[own]

    def adopt(self, meaning: _Meaning) -> None:
        """Note what was open, and read the boxes as they are meant."""
        self._note_open(meaning)
        pairs = zip(self.boxes, self.raws, strict=True)
        self.boxes = [None if own is None else _as_meant(own, raw, meaning) for own, raw in pairs]

    def _note_open(self, meaning: _Meaning) -> None:
        """Note what of the reading was not stated."""
        reading, why = meaning.reading, meaning.why
        if any(raw.turns for raw in self.raws):
            self._note("angles", f"{turns_in_words(reading.turns)}, {why}; --euler")
        if reading.lean != (0.0, 0.0):
            degrees = np.degrees(np.arcsin(np.hypot(*reading.lean)))
            how = f"the world is turned by {degrees:.0f}° so that people stand"
            self._note("level", how)
        convention, by_boxes = self.convention, meaning.height is not None
        for name, known, flag in (
            ("direction", convention.direction, "pose"),
            ("axes", convention.axes, "axes"),
            ("up", convention.up, "up"),
            ("unit", convention.unit, "unit"),
        ):
            by_height = name == "unit" and by_boxes
            if known is None and not (by_height and self._unit_is_arbitrary):
                how = "by the height of people" if by_height else why
                self._note(name, f"{getattr(reading, name)}, {how}; --{flag}")
        if reading.parts > 1:
            self._note("boxes", f"{PARTS[reading.parts]}, {why}")

    # cameras and clocks

    def place_cameras(self, meaning: _Meaning) -> list[Camera]:
        """Return the cameras in metres, z up."""
        raws, factor, stated = self.raws, None, self.options.half_extents
        if meaning.height is not None and self._unit_is_arbitrary:
            factor = (PERSON if stated is None else 2.0 * stated[2]) / meaning.height
            raws = [_resized(raw, factor) for raw in raws]
        cameras = [
            to_camera(raw, meaning.of_poses, raw.image_size or size)
            for raw, size in zip(raws, self.sizes, strict=True)
        ]
        check_places(cameras, self.matched.format)
        if factor is None:
            return cameras
        if stated is not None:
            how = f"scaled by {factor:.4g}, so that people are {2.0 * stated[2]:g} m; --unit"
            self._note("unit", how)
            return cameras
        more, why = 1.0, AS_STANDING
        if self.times.stated:
            more, why = paced(cameras, self.at_steps, self.times.fps)
        self._note("unit", f"scaled by {more * factor:.4g}, {why}: --unit")
        return resized(cameras, more)

    def set_clocks(self, verdict: Verdict | None, fps: float | None = None) -> None:
        """Turn back the clocks of cameras that are late by the boxes; what is stated is kept.

        Args:
            verdict: What the boxes tell, if they tell anything.
            fps: Steps a second, where no file states it; None for those of the files.
        """
        clocks = {} if verdict is None else verdict.clocks
        late = {self.names[camera]: clock.late for camera, clock in clocks.items() if clock.late}
        stated = self.options.offsets
        self.late = {name: steps for name, steps in late.items() if name not in stated}
        rate = self.times.fps if fps is None else fps
        offsets = {name: -steps / rate for name, steps in self.late.items()} | {**stated}
        changes = {"offsets": offsets} if fps is None else {"offsets": offsets, "fps": fps}
        options = self.options.model_copy(update=changes)
        self.times = settle_times(self.matched.cameras, self.matched.truths, options, [])

    def find_rate(self, cameras: Sequence[Camera], verdict: Verdict | None) -> Verdict | None:
        """Settle the rate by how fast people go, and return the verdict at this rate."""
        fps, why = rate_of(cameras, self.at_steps)
        self._note("fps", f"{fps:g}, {why}, since no file says it; --fps")
        verdict = None if verdict is None else verdict.at_rate(fps)
        self.set_clocks(verdict, fps)
        return verdict

    def describe_clocks(self, verdict: Verdict | None) -> None:
        """Say which cameras are late, and of which nothing confirms their moments."""
        fps = self.times.fps
        if verdict is not None:
            unconfirmed = describe_unconfirmed(verdict, self.names, fps)
            self.sentences += filter(None, (unconfirmed.alone, unconfirmed.others))
            self.sentences += describe_clocks(verdict.clocks, self.names, fps)
        for name, steps in self.late.items():
            how = f"{steps / fps:.2f} s late ({steps} steps, within 1), since boxes meet so"
            self._note(f"{name} clock", how)

    # the plan

    def plan(self, cameras: Sequence[Camera], reading: Reading) -> ImportPlan:
        """Return the plan, with room, truth and names.

        Args:
            cameras: In metres, z up.
            reading: How their calibration is meant.
        """
        matched, options = self.matched, self.options
        looked_at = self._looked_at()
        suggested = self._suggest_room(cameras)
        room = _with_stated_room(suggested, options)
        surroundings = Surroundings(
            cameras,
            self.at_steps,
            [None if c.detections is None else c.detections.camera for c in matched.cameras],
            reading,
            self.times.frames,
            room.floor,
            float(room.half_extents[2]) + room.floor,
            options.first_index,
        )
        truth = settle_truth([piece for _, piece in matched.truths], surroundings, self.notes)
        views = map(
            PlannedView,
            self._renamed(cameras),
            matched.cameras,
            self.detections,
            self.times.cameras,
            looked_at,
        )
        return ImportPlan(
            tuple(views),
            self.times.fps,
            self.times.frames,
            room,
            suggested,
            _entrances(options),
            truth,
            matched.format,
            reading,
            tuple(self.notes),
            tuple(_summed_up(self.sentences)),
            _sources(matched),
            self.accepted,
        )

    def _looked_at(self) -> list[Int[ndarray, " K"] | None]:
        """Return the frames at which detectors ran, where these are every second, third … one."""
        result: list[Int[ndarray, " K"] | None] = []
        gaps: dict[int, list[str]] = {}
        every_camera = [own.frames for own in self.detections if own is not None]
        for name, own in zip(self.names, self.detections, strict=True):
            others = [frames for frames in every_camera if own is None or frames is not own.frames]
            gap = 1 if own is None else regular_gap(own.frames, *others)
            first, last = (0, 0) if own is None or gap == 1 else (own.frames[0], own.frames[-1])
            result.append(None if gap == 1 else np.arange(first % gap, last + 1, gap))
            if gap > 1:
                gaps.setdefault(gap, []).append(name)
        for gap, names in gaps.items():
            how = f"ran at {in_gaps(gap)} of {', '.join(names)}; others were not looked at"
            self._note("detector", how)
        return result

    def _suggest_room(self, cameras: Sequence[Camera]) -> Suggestion:
        """Suggest where people are, and how large they are: from the boxes, else from the views."""
        agreed = None
        if any(own is not None for own in self.boxes):
            agreed = consensus_of_cameras(cameras, rays_of_all(cameras, self.at_steps))
        room = suggest(cameras, agreed)
        if room is None:
            centres = np.array([camera.centre for camera in cameras])
            low, high = centres.min(axis=0) - 3.0, centres.max(axis=0) + 3.0
            room = Suggestion(
                np.array([low[0], low[1], 0.0]), np.array([high[0], high[1], 2.0]), STANDING, 0.0, 0
            )
            self._note("room", "around the cameras: neither boxes nor views meet; correct it")
            return room
        margin = np.array([ROOM_MARGIN, ROOM_MARGIN, 0.0])
        room = replace(room, minimum=room.minimum - margin, maximum=room.maximum + margin)
        pairs = f"from {room.people} pairs of boxes that meet"
        how = pairs if room.people else "where views overlap"
        sides = " × ".join(f"{side:.1f}" for side in _sides(room))
        self._note("room", f"{sides} m, {how}")
        size = " × ".join(f"{2.0 * side:.2f}" for side in room.half_extents)
        how = "from the boxes" if room.people else "a standing person"
        self._note("target", f"{size} m, {how}")
        return room

    def _renamed(self, cameras: Sequence[Camera]) -> list[Camera]:
        """Return the cameras under the names that are wished, and that can be written."""
        renamed: list[Camera] = []
        for camera in cameras:
            wished = self.options.names.get(camera.name, camera.name).strip()
            name = plain_name(wished) if wished else ""
            if name != wished and camera.name in self.options.names:
                raise FormatError(
                    f"name of {camera.name}: expected one without blanks, commas, quotes and #, "
                    f'since it heads columns of tables, found "{wished}"; "{name}" would do'
                )
            if name != wished:
                self._note("name", f'"{camera.name}" is called {name}: names head columns of CSV')
            renamed.append(replace(camera, name=name))
        names = [camera.name for camera in renamed]
        for name in names:
            if not name or names.count(name) > 1:
                raise FormatError(
                    f'expected a name of its own for each camera, found "{name}"'
                    f"{' twice' if name else ''}; choose another"
                )
        return renamed


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


def _unused(matched: Matched) -> list[MatchedCamera]:
    """Calibrations without files that may be those of boxes which no name gave to a camera."""
    known = [camera for camera in matched.spare if camera.raw.image_size is not None]
    few = len(matched.cameras) + len(known) <= MOST_CAMERAS
    return known if few and matched_by(matched.cameras) != "name" else []


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


def _with_stated_room(room: Suggestion, options: ImportOptions) -> Suggestion:
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


def _with_stated(raw: RawCamera, options: ImportOptions) -> RawCamera:
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


def _as_meant(own: _Boxes, raw: RawCamera, meaning: _Meaning) -> _Boxes:
    """Return a camera's boxes as they are meant, sorted by step, without those without size."""
    reading = meaning.reading
    finer = reading.parts if reading.parts > 1 else 0
    boxes = own.detections
    four = boxes.boxes
    if own.layout is None or finer:
        scale = raw.image_size if finer else own.scale
        layout = reading.layout if own.layout is None else "ltwh"
        four = read_boxes(four, layout, scale, max(finer, 1))
    if meaning.wider != 1.0:
        corners = (four[:, :2] + 0.5) / meaning.wider - 0.5
        four = np.column_stack([corners, four[:, 2:] / meaning.wider])
    order = np.argsort(boxes.frames, kind="stable")
    order = order[(four[order, 2:] > 0.0).all(axis=1)]
    return _Boxes(Detections(boxes.frames[order], four[order], boxes.scores[order]), reading.layout)


def _stated_of_poses(options: ImportOptions) -> str:
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


def _compared(own: Detections, time: CameraTime) -> Seen:
    """Return the boxes by step that are compared with other cameras'."""
    steps = time.steps_of(own.frames)
    kept = (steps >= 0) & compared(own.scores)
    return Seen(steps[kept], own.boxes[kept])


def _sides(room: Suggestion) -> Float[ndarray, " 3"]:
    return np.asarray(room.maximum - room.minimum)
