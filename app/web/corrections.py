"""Corrections and moments under review over HTTP: messages, what a page states, routes."""

from __future__ import annotations

import hashlib
import io
from collections.abc import Set as AbstractSet
from typing import Annotated, Literal

import numpy as np
from fastapi import APIRouter, Response
from pydantic import Field

from app.errors import ApiError
from app.messages import Model, Vector, filled
from app.state.correcting import Correcting, Doubting
from app.state.snapshot import Ghosts, Snapshot
from app.web.dependencies import ERRORS, Bench, Owned, Work, download, file_name, opened
from tracker.corrections import Correction, CorrectionError, Place
from tracker.corrections.kinds import KINDS, make
from tracker.corrections.outcomes import Outcome, names_by_track
from tracker.corrections.pointing import foot_on_floor, ground_under, stands, triangulate
from tracker.corrections.truth import checked_ranges, write_truth
from tracker.fusion.trajectories import Trajectories, apply_corrections
from tracker.review.queue import Queue, ReviewItem
from tracker.review.queue.item import WITHIN, TrackRows
from tracker.runs.camera_notes import out_of_line_notes
from tracker.runs.pipeline import Run
from tracker.sequences.sequence import Sequence

Kind = Literal[
    "same", "different", "exchanged", "here", "nobody", "came", "left", "name", "checked"
]

Step = Annotated[int, Field(ge=0)]
Finite = Annotated[float, Field(ge=-1e5, le=1e5, allow_inf_nan=False)]


class Click(Model):
    """A place in a picture: where somebody's feet are, or, in two pictures, the same point."""

    camera: str = Field(max_length=200)
    """Its name."""
    x: Finite
    """Pixels."""
    y: Finite


class CorrectionWish(Model):
    """What somebody says; of whom is told by tracks of the shown run."""

    kind: Kind
    step: Step | None = None
    """Where; of most kinds the playhead's, where none is given."""
    to: Step | None = None
    """Of *exchanged*: from which step on they are themselves again."""
    tracks: list[int] = Field(default=[], max_length=2)
    """Ids of the shown run."""
    place: tuple[Finite, Finite, Finite] | None = None
    """Metres, world frame, the middle of the target: of *here*."""
    clicks: list[Click] = Field(default=[], max_length=2)
    """Of *here*, instead: the feet in one picture, or one point of the person in two."""
    accuracy: float | None = Field(default=None, ge=0.01, le=5.0)
    """Metres."""
    name: str | None = Field(default=None, min_length=1, max_length=80)
    first: Step | None = None
    """Of *checked*, and of *nobody* where it is not a whole life."""
    last: Step | None = None


class GhostsRequest(Model):
    """How it would be, to be shown in 3D; or that no more."""

    doubt: str | None = Field(default=None, max_length=40)
    """Of the queue; null: what is shown goes away."""
    alternative: int = Field(default=0, ge=0, le=20)
    """0: as it is."""


class CorrectionInfo(Model):
    """One correction."""

    id: str
    kind: Kind
    words: str
    note: str
    time: str
    first: int
    """Steps that it speaks of, both included."""
    last: int
    places: list[tuple[int, float, float, float]]
    """Step and world metres."""
    accuracy: float | None
    name: str | None
    met: bool | None
    """By the shown run; null while that is computed."""
    why: str
    """Where it is not met."""
    tracks: list[int]
    """Ids of whom it means in the shown run."""


class Corrections(Model):
    """All of the open recording, in their order."""

    run: str | None
    """Key of the run that they were held against."""
    file: str
    """Where they are kept."""
    problem: str | None
    """Why the file cannot be used: nothing is obeyed then."""
    corrections: list[CorrectionInfo]
    checked: list[tuple[int, int]]
    """Ranges of steps that somebody has looked at, without overlap, in order."""
    names: dict[int, str]
    """Of tracks of the shown run."""


class AlternativeInfo(Model):
    """What may be true at a doubtful place."""

    words: str
    probability: float
    as_it_is: bool


class Sight(Model):
    """Where in a camera's picture somebody would be whom no track has."""

    step: int
    camera: int
    box: tuple[float, float, float, float]
    """left, top, width, height, pixels."""


class DoubtInfo(Model):
    """A doubtful place."""

    id: str
    kind: Literal[
        "exchange", "join", "cut", "crossing", "gap", "short", "begins", "ends", "missing", "fast"
    ]
    title: str
    why: str
    first: int
    last: int
    tracks: list[int]
    places: list[tuple[int, float, float, float]]
    doubt: float
    """Probability that the run is wrong there."""
    stake: int
    """Steps that depend on it."""
    alternatives: list[AlternativeInfo]
    """As it is, then the most probable first."""
    sights: list[Sight]
    """Of who may be missing, at its places; empty for all others, whose boxes are their tracks'."""


class DoubtQueue(Model):
    """The doubtful places of the shown run, the most at stake first."""

    run: str | None
    complete: bool
    """Whether the run is."""
    how: str
    """By what they were judged."""
    answered: int
    """Places that corrections settle."""
    cameras: list[str]
    """Sentences about cameras whose boxes err more than those of the others."""
    doubts: list[DoubtInfo]


class GhostTrack(Model):
    """A track as it would be."""

    id: int
    first: int
    positions: list[Vector | None]
    """World metres, one a step from ``first`` on; null where it is not there."""


class ChangedSpan(Model):
    """A part of a track that would be another's."""

    id: int
    """Whose it would be; 0 for nobody's."""
    was: int
    first: int
    last: int


class AlternativePreview(Model):
    """What the tracks would be around a doubtful place, if an alternative were true."""

    tracks: list[GhostTrack]
    spans: list[ChangedSpan]
    """Over the whole recording."""


class CorrectionsState(Model):
    """How corrections stand."""

    key: str
    """Another for every change of them, or of what became of them: read them again."""
    count: int
    unmet: int


def known_item(item: ReviewItem | None, identity: str) -> ReviewItem:
    """A moment under review.

    Raises:
        ApiError: If there is none of that id.
    """
    if item is None:
        raise ApiError(
            404, "no_doubt", f"There is no doubtful place {identity} any more.",
            hint="The list of places to check has those of the shown run.",
        )  # fmt: skip
    return item


def alternative_of(item: ReviewItem, number: int) -> int:
    """The number of an alternative.

    Raises:
        ApiError: If there is none of that number.
    """
    if not 0 <= number < len(item.alternatives):
        raise ApiError(
            404, "no_alternative", f"Expected an alternative below {len(item.alternatives)}, "
            f"got {number}.", hint="0 is as it is.",
        )  # fmt: skip
    return number


GHOST_SECONDS = 5.0
"""Before and after a doubtful place."""


def _outcomes(snapshot: Snapshot) -> dict[str, Outcome]:
    """What became of each in the shown run, where that is the one that is asked for."""
    run = snapshot.run
    if run is None or run.key != snapshot.run_state.key:
        return {}
    return {one.id: one for one in run.outcomes}


def state_of(snapshot: Snapshot) -> CorrectionsState:
    """How corrections stand."""
    found = _outcomes(snapshot)
    said = [*(one.id for one in snapshot.corrections), *map(str, found.values())]
    key = hashlib.sha256("|".join([snapshot.sequence_key, *said]).encode()).hexdigest()[:12]
    unmet = sum(not one.met for one in found.values())
    return CorrectionsState(key=key, count=len(snapshot.corrections), unmet=unmet)


def corrections_of(snapshot: Snapshot, correcting: Correcting) -> Corrections:
    """All of them in their order."""
    found = _outcomes(snapshot)
    infos = []
    for one in snapshot.corrections:
        first, last = one.steps
        outcome = found.get(one.id)
        if one.kind == "checked":  # it asks nothing of a run
            outcome = Outcome(one.id, True)
        infos.append(
            filled(
                CorrectionInfo, one, time=one.time.isoformat(), first=first, last=last,
                places=[(p.step, p.x, p.y, p.z) for p in one.places],
                met=None if outcome is None else outcome.met,
                why="" if outcome is None else outcome.why,
                tracks=[] if outcome is None else list(outcome.tracks),
            )
        )  # fmt: skip
    return Corrections(
        run=None if snapshot.run is None else snapshot.run.key,
        file=str(correcting.log.path),
        problem=correcting.log.problem,
        corrections=infos,
        checked=checked_ranges(snapshot.corrections),
        names=names_by_track(tuple(found.values()), snapshot.corrections),
    )


def queue_of(snapshot: Snapshot, found: Queue, skipped: AbstractSet[str]) -> DoubtQueue:
    """The doubtful places, but for those that were passed over."""
    run = snapshot.run
    return DoubtQueue(
        run=None if run is None else run.key,
        complete=run is not None and run.complete,
        how=found.how,
        answered=found.answered,
        cameras=[] if run is None else out_of_line_notes(run),
        doubts=[_doubt(one, run) for one in found.items if one.id not in skipped],
    )


def _doubt(one: ReviewItem, run: Run | None) -> DoubtInfo:
    return filled(
        DoubtInfo, one, tracks=list(one.tracks),
        places=[(p.step, p.x, p.y, p.z) for p in one.places], doubt=one.probability,
        alternatives=[
            filled(AlternativeInfo, a, as_it_is=number == 0)
            for number, a in enumerate(one.alternatives)
        ],
        sights=[] if one.tracks or run is None else _sights(one, run),
    )  # fmt: skip


def _sights(one: ReviewItem, run: Run) -> list[Sight]:
    points = np.array([place.point for place in one.places])
    found = []
    for number, camera in enumerate(run.sequence.cameras):
        boxes, visible = camera.project_boxes(points, run.sequence.target_half_extents)
        found += [
            Sight(step=place.step, camera=number, box=tuple(box))
            for place, box, there in zip(one.places, boxes.tolist(), visible, strict=True)
            if there
        ]
    return found


def preview_of(snapshot: Snapshot, doubt: ReviewItem, alternative: int) -> AlternativePreview:
    """The tracks as they would be if an alternative were true: at once, by their rows alone."""
    assert snapshot.run is not None
    run = snapshot.run.snapshot()
    after = _after(run, doubt, alternative)
    first, last = _around(run, doubt)
    spans = _spans(run.tracks, after)
    lanes = TrackRows(after)
    touched = _touched(doubt, spans) & set(lanes.rows)
    ghosts = [_ghost(lanes, track, first, last) for track in sorted(touched)]
    return AlternativePreview(tracks=ghosts, spans=spans)


def ghosts_of(snapshot: Snapshot, doubt: ReviewItem, alternative: int) -> Ghosts:
    """The same for the 3D view."""
    assert snapshot.run is not None
    run = snapshot.run.snapshot()
    after = _after(run, doubt, alternative)
    first, last = _around(run, doubt)
    touched = _touched(doubt, _spans(run.tracks, after))
    near = (after.frames >= first) & (after.frames <= last)
    return Ghosts(run.key, after.take(near & np.isin(after.ids, sorted(touched))))


def _after(run: Run, doubt: ReviewItem, alternative: int) -> Trajectories:
    if not alternative:
        return run.tracks
    said = doubt.alternatives[alternative].corrections
    return apply_corrections(run.tracks, said, run.sequence.step_time)


def _around(run: Run, doubt: ReviewItem) -> tuple[int, int]:
    margin = round(GHOST_SECONDS / run.sequence.step_time)
    return max(doubt.first - margin, 0), min(doubt.last + margin, run.sequence.frames - 1)


def _touched(doubt: ReviewItem, spans: list[ChangedSpan]) -> set[int]:
    return {*doubt.tracks, *(one.id for one in spans if one.id)}


def _ghost(lanes: TrackRows, track: int, first: int, last: int) -> GhostTrack:
    positions: list[Vector | None] = [None] * (last - first + 1)
    for row in lanes.rows[track].tolist():
        step = int(lanes.tracks.frames[row])
        if first <= step <= last:
            x, y, z = lanes.tracks.positions[row].tolist()
            positions[step - first] = (x, y, z)
    return GhostTrack(id=track, first=first, positions=positions)


def _spans(before: Trajectories, after: Trajectories) -> list[ChangedSpan]:
    """Where whose track it is changes, part by part."""
    place = {
        (step, *spot): track
        for step, spot, track in zip(
            after.frames.tolist(), after.positions.tolist(), after.ids.tolist(), strict=True
        )
    }
    lanes, found = TrackRows(before), []
    for track, rows in lanes.rows.items():
        frames = before.frames[rows]
        new = np.array(
            [
                place.get((step, *spot), 0)
                for step, spot in zip(frames.tolist(), before.positions[rows].tolist(), strict=True)
            ]
        )
        for part in np.split(np.arange(len(new)), np.flatnonzero(np.diff(new)) + 1):
            now = int(new[part[0]])
            if now != track:
                first, last = int(frames[part[0]]), int(frames[part[-1]])
                found.append(ChangedSpan(id=now, was=track, first=first, last=last))
    return found


def stated_corrections(
    wish: CorrectionWish, snapshot: Snapshot, note: str
) -> tuple[Correction, ...]:
    """What a wish says.

    Args:
        wish: Of tracks of the shown run.
        snapshot: With that run.
        note: Written beside each.

    Raises:
        CorrectionError: If it means nobody, or is not what its kind needs.
    """
    sequence = snapshot.sequence
    if sequence is None:
        raise CorrectionError("no recording is open")
    if wish.kind == "checked":
        return (make(kind="checked", first=wish.first, last=wish.last, note=note),)
    step = snapshot.playhead if wish.step is None else wish.step
    for one in (step, wish.to, wish.first, wish.last):
        if one is not None and one >= sequence.frames:
            raise CorrectionError(f"step: expected 0 … {sequence.frames - 1}, found {one}")
    if wish.kind == "here" and (wish.clicks or wish.place is not None):
        return (_here(wish, snapshot, sequence, step, note),)
    return _of_tracks(wish, snapshot, step, note)


def _of_tracks(
    wish: CorrectionWish, snapshot: Snapshot, step: int, note: str
) -> tuple[Correction, ...]:
    if snapshot.run is None:
        raise CorrectionError("there is no run yet whose tracks could be meant")
    lanes = TrackRows(snapshot.run.tracks)
    needed = 2 if wish.kind in ("exchanged", "same") else 1
    if len(wish.tracks) != needed or len(set(wish.tracks)) != needed:
        raise CorrectionError(
            f"tracks: {wish.kind} is of {needed} of them, found {len(wish.tracks)}"
        )
    for track in wish.tracks:
        if track not in lanes.rows:
            raise CorrectionError(f"tracks: the shown run has no track {track}")
    one = wish.tracks[0]
    if wish.kind == "exchanged":
        back = () if wish.to is None else (_exchanged(lanes, wish.tracks, wish.to, note),)
        return (_exchanged(lanes, wish.tracks, step, note), *back)
    if wish.kind == "same":
        first, second = sorted(wish.tracks, key=lambda track: lanes.span(track)[1])
        if wish.step is None or lanes.span(first)[1] < lanes.span(second)[0]:
            begin = lanes.span(second)[0]
            end = min(lanes.span(first)[1], max(begin - 1, lanes.span(first)[0]))
        else:
            begin, end = step, step - 1
        places = [lanes.place(first, end), lanes.place(second, begin, after=True)]
        return (make(kind="same", places=places, note=note),)
    if wish.kind == "different":
        before, after = lanes.place(one, step - 1), lanes.place(one, step, after=True)
        if before.step >= after.step:
            raise CorrectionError(f"step: track {one} begins or ends there, and cannot be cut")
        return (make(kind="different", places=[before, after], note=note),)
    if wish.kind == "nobody":
        return (_nobody(lanes, one, wish, note),)
    if wish.kind in ("came", "left"):
        at = wish.step
        if at is None:
            at = lanes.span(one)[wish.kind == "left"]
        place = lanes.place(one, at, after=wish.kind == "came")
        return (make(kind=wish.kind, places=[place], note=note),)
    place = lanes.place(one, step)
    if wish.kind == "name":
        return (make(kind="name", places=[place], name=wish.name, note=note),)
    return (make(kind="here", places=[place], accuracy=wish.accuracy, note=note),)


def _here(
    wish: CorrectionWish, snapshot: Snapshot, sequence: Sequence, step: int, note: str
) -> Correction:
    """Where somebody is; who is meant by where the shown run has the track."""
    places = [_place(wish, snapshot, sequence, step)]
    low, high = sequence.room.minimum, sequence.room.maximum
    if not all(low[k] <= places[0][1 + k] <= high[k] for k in (0, 1)):
        raise CorrectionError(
            f"place: {places[0].words} lies outside the room, x {low[0]:.1f} … {high[0]:.1f} and "
            f"y {low[1]:.1f} … {high[1]:.1f} m, where nobody is tracked; make the room larger first"
        )
    meant = _shown_at(wish, snapshot, step)
    if meant is not None:
        places.append(meant)
    return make(kind="here", places=places, accuracy=wish.accuracy, note=note)


def _exchanged(lanes: TrackRows, tracks: list[int], step: int, note: str) -> Correction:
    one, other = tracks
    before = [lanes.place(track, step - 1) for track in (one, other)]
    after = [lanes.place(track, step, after=True) for track in (other, one)]
    for track, place in zip((one, other, other, one), (*before, *after), strict=True):
        at_all = lanes.span(track)
        if (place in before) != (place.step < step):
            raise CorrectionError(
                f"step: track {track} is there from step {at_all[0]} to {at_all[1]} only, so it "
                f"cannot be exchanged at step {step}"
            )
    return make(kind="exchanged", places=[*before, *after], note=note)


def _nobody(lanes: TrackRows, track: int, wish: CorrectionWish, note: str) -> Correction:
    begin, end = lanes.span(track)
    first = begin if wish.first is None else wish.first
    last = end if wish.last is None else wish.last
    frames = lanes.tracks.frames[lanes.rows[track]]
    own = lanes.rows[track][(frames >= first) & (frames <= last)]
    if not len(own):
        raise CorrectionError(f"first, last: track {track} is not there between them")
    around = KINDS["nobody"].accuracy if wish.accuracy is None else wish.accuracy
    places = lanes.simplified_path(own, WITHIN * (around or 0.0))
    return make(kind="nobody", places=places, accuracy=wish.accuracy, note=note)


def _place(wish: CorrectionWish, snapshot: Snapshot, sequence: Sequence, step: int) -> Place:
    if wish.place is not None:
        return Place(step, *wish.place)
    cameras = {camera.name: camera for camera in sequence.cameras}
    for click in wish.clicks:
        if click.camera not in cameras:
            raise CorrectionError(f"clicks: there is no camera {click.camera}")
    points = [(cameras[click.camera], (click.x, click.y)) for click in wish.clicks]
    half_height = float(sequence.target_half_extents[2])
    meant = _shown_at(wish, snapshot, step)
    feet = None if meant is None else meant.z - half_height
    ground = ground_under(feet, floor=float(sequence.room.minimum[2]), half_height=half_height)
    if len(points) == 1:
        found = foot_on_floor(*points[0], floor=ground, half_height=half_height)
    else:
        found = triangulate(points)
        # any point of somebody who stands says where: the middle is half a person over the floor
        if stands(float(found[2]), ground=ground, half_height=half_height):
            found[2] = ground + half_height
    return Place(step, *found.tolist())


def _shown_at(wish: CorrectionWish, snapshot: Snapshot, step: int) -> Place | None:
    """Where the shown run has the track that is meant, if it is there."""
    if snapshot.run is None or not wish.tracks:
        return None
    lanes = TrackRows(snapshot.run.tracks)
    if wish.tracks[0] not in lanes.rows:
        return None
    found = lanes.place(wish.tracks[0], step)
    return found if found.step == step else None


SETTLES_SECONDS = 10.0
"""So long the truth waits for the run that obeys what was just said."""

router = APIRouter(prefix="/api/corrections", responses=ERRORS)


@router.get("")
def corrections(bench: Bench, owners: Owned) -> Corrections:
    """All of them in their order, with what became of each in the shown run."""
    opened(bench)
    owners.correcting.refresh()
    return corrections_of(bench.snapshot(), owners.correcting)


@router.get("/queue")
def doubtful_places(bench: Bench, owners: Owned) -> DoubtQueue:
    """The doubtful places of the shown run, the most at stake first."""
    snapshot, _ = opened(bench)
    return queue_of(snapshot, owners.doubting.of(snapshot), owners.correcting.skipped)


@router.get("/queue/{doubt}/{alternative}")
def preview(doubt: str, alternative: int, bench: Bench, owners: Owned) -> AlternativePreview:
    """What the tracks would be if an alternative were true: ghosts and changed lanes."""
    snapshot, _ = opened(bench)
    found = _found(owners.doubting, snapshot, doubt)
    return preview_of(snapshot, found, alternative_of(found, alternative))


@router.post("/ghosts")
def ghosts(wish: GhostsRequest, bench: Bench, owners: Owned) -> AlternativePreview:
    """Have the 3D view show what the tracks would be, or that no more; what they would be."""
    snapshot, _ = opened(bench)
    if wish.doubt is None:
        bench.show_ghosts(None)
        return AlternativePreview(tracks=[], spans=[])
    found = _found(owners.doubting, snapshot, wish.doubt)
    chosen = alternative_of(found, wish.alternative)
    told = preview_of(snapshot, found, chosen)
    bench.show_ghosts(ghosts_of(snapshot, found, chosen))
    return told


@router.get("/truth.csv", response_class=Response)
def truth(bench: Bench, work: Work) -> Response:
    """The corrected tracks of the checked steps, as a truth that `evaluate` reads."""
    opened(bench)
    snapshot = work.settled(SETTLES_SECONDS)
    run = snapshot.run
    if run is None or not run.complete or snapshot.run_state.state == "computing":
        raise ApiError(
            409, "no_run", "The run is not finished.", hint="Wait until it is, then ask again."
        )
    text = io.StringIO(newline="")
    write_truth(text, run.tracks, snapshot.corrections)
    name = file_name(run.sequence.name, "truth.csv")
    return download(text.getvalue(), name, "text/csv")


def _found(doubts: Doubting, snapshot: Snapshot, identity: str) -> ReviewItem:
    return known_item(doubts.find(snapshot, identity), identity)
