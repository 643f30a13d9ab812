"""Corrections and doubtful places as the page gets them."""

from __future__ import annotations

import hashlib
from collections.abc import Set as AbstractSet

import numpy as np

from app.models.base import Vector
from app.models.correcting import (
    AlternativeInfo,
    AlternativePreview,
    ChangedSpan,
    CorrectionInfo,
    Corrections,
    CorrectionsState,
    DoubtInfo,
    DoubtQueue,
    GhostTrack,
    Sight,
)
from app.state.correcting import Correcting
from app.state.snapshot import Ghosts, Snapshot
from tracker.corrections.outcomes import Outcome, names_by_track
from tracker.corrections.truth import checked_ranges
from tracker.fusion.trajectories import Trajectories, apply_corrections
from tracker.review.queue import Queue, ReviewItem
from tracker.review.queue.item import TrackRows
from tracker.runs.camera_notes import out_of_line_notes
from tracker.runs.pipeline import Run

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
            CorrectionInfo(
                id=one.id, kind=one.kind, words=one.words, note=one.note,
                time=one.time.isoformat(), first=first, last=last,
                places=[(p.step, p.x, p.y, p.z) for p in one.places],
                accuracy=one.accuracy, name=one.name,
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
    return DoubtInfo(
        id=one.id, kind=one.kind, title=one.title, why=one.why, first=one.first, last=one.last,
        tracks=list(one.tracks), places=[(p.step, p.x, p.y, p.z) for p in one.places],
        doubt=one.probability, stake=one.stake,
        alternatives=[
            AlternativeInfo(words=a.words, probability=a.probability, as_it_is=number == 0)
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
