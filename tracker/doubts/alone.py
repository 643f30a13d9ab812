"""Doubts about one track by itself, and about two people who come close."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

from tracker.doubts.doubt import Alternative, Doubt, Lanes, unsaid
from tracker.doubts.linking import Move, Piece
from tracker.runs.run import Run

_SHORT = 1.0
"""Seconds of a track that may be nobody."""

_UNSEEN = 1.0
"""Seconds for which no camera has somebody: a long miss."""

_CLOSE = 2.0
"""Target widths within which two people are close."""

_ALONE = 1.5
"""Log odds by which it is rarer that of two who meet one goes on as the other and he as nobody."""

_FASTEST = 3.0
"""Metres a second that nobody in a room exceeds for long."""


def of_tracks(run: Run, lanes: Lanes) -> Iterator[Doubt]:
    """Who may be nobody."""
    for track in lanes.ids.tolist():
        yield from _nobody(run, lanes, track)


def moves(run: Run, lanes: Lanes) -> Iterator[Move]:
    """Where a track may go on as another person: it was gone, or jumps, or met somebody."""
    for track in lanes.ids.tolist():
        yield from _unseen(run, lanes, track)
        yield from _fast(run, lanes, track)
    yield from _close(run, lanes)


def _nobody(run: Run, lanes: Lanes, track: int) -> Iterator[Doubt]:
    """A short life, or one of few sights."""
    rows, tracks = lanes.rows[track], run.tracks
    life = len(rows) * run.sequence.step_time
    sights = tracks.seen[rows].sum(axis=1)
    cameras = int(tracks.seen[rows].any(axis=0).sum())
    existence = float(tracks.existences[rows].mean())
    seen = float((sights > 0).mean())
    one_alone = cameras == 1 and tracks.seen.shape[1] > 1
    wrong = (1.0 - min(existence, 1.0) * seen) * 0.6
    wrong += 0.3 * np.exp(-life / _SHORT) + (0.2 if one_alone else 0.0)
    if wrong < 0.05:
        return
    first, last = lanes.span(track)
    chosen = np.unique(np.linspace(0, len(rows) - 1, min(len(rows), 12)).round().astype(int))
    places = tuple(lanes.of_row(int(rows[k])) for k in chosen)
    wrong = float(min(wrong, 0.95))
    how = f"{life:.1f} s long, seen at {100 * seen:.0f} % of its steps"
    if one_alone:
        how += " by one camera alone"
    yield Doubt(
        "short", f"{track} is nobody?", how, first, last, (track,), (places[0], places[-1]),
        wrong, len(rows),
        (
            Alternative("as it is", 1.0 - wrong, unsaid("same", (places[0], places[-1]))),
            Alternative("nobody", wrong, unsaid("nobody", places)),
        ),
    )  # fmt: skip


def _unseen(run: Run, lanes: Lanes, track: int) -> Iterator[Move]:
    """Long misses within a life: who comes back may be somebody else."""
    rows, tracks = lanes.rows[track], run.tracks
    seen = np.flatnonzero(tracks.seen[rows].any(axis=1))
    for a, b in itertools.pairwise(seen):
        before, after = lanes.of_row(int(rows[a])), lanes.of_row(int(rows[b]))
        seconds = (after.step - before.step) * run.sequence.step_time
        if seconds <= _UNSEEN:
            continue
        why = f"no camera has it from step {before.step + 1} to {after.step - 1}"
        wrong = 0.4 * (1.0 - np.exp(-seconds / 5.0))
        piece = Piece(track, after, before)
        yield Move((piece,), (piece,), "gap", _odds(wrong), why)


def _fast(run: Run, lanes: Lanes, track: int) -> Iterator[Move]:
    """Where it goes faster than anybody."""
    rows, tracks = lanes.rows[track], run.tracks
    frames, ground = tracks.frames[rows], tracks.positions[rows, :2]
    seconds = np.diff(frames) * run.sequence.step_time
    speed = np.linalg.norm(np.diff(ground, axis=0), axis=1) / np.maximum(seconds, 1e-9)
    fast = np.flatnonzero(speed > _FASTEST)
    for k in fast[np.diff(fast, prepend=-9) > 1].tolist():
        before, after = lanes.of_row(int(rows[k])), lanes.of_row(int(rows[k + 1]))
        piece = Piece(track, after, before)
        why = f"{speed[k]:.1f} m/s at step {after.step}"
        yield Move((piece,), (piece,), "fast", _odds(min(0.3 * speed[k] / _FASTEST, 0.9)), why)


def _close(run: Run, lanes: Lanes) -> Iterator[Move]:
    """Two people so near that they may have been exchanged: once for each time they meet."""
    tracks = run.tracks
    width = 2.0 * float(run.sequence.target_half_extents[:2].mean())
    reach = _CLOSE * width
    meetings: dict[tuple[int, int], list[tuple[int, float]]] = {}
    for step in np.unique(tracks.frames).tolist():
        own = tracks.at(step)
        ids, ground = tracks.ids[own], tracks.positions[own, :2]
        apart = np.linalg.norm(ground[:, None] - ground[None], axis=2)
        for a, b in np.argwhere(np.triu(apart < reach, 1)).tolist():
            pair = (int(ids[a]), int(ids[b]))
            meetings.setdefault(pair, []).append((step, float(apart[a, b])))
    pause = max(round(1.0 / run.sequence.step_time), 2)
    for (one, other), met in meetings.items():
        steps = np.array([step for step, _ in met])
        for part in np.split(np.arange(len(met)), np.flatnonzero(np.diff(steps) > pause) + 1):
            nearest = min((met[k] for k in part.tolist()), key=lambda at: at[1])
            first, last = int(steps[part[0]]) - 1, int(steps[part[-1]]) + 1
            mine, theirs = (
                Piece(track, lanes.place(track, last, after=True), lanes.place(track, first))
                for track in (one, other)
            )
            wrong = 0.12 * np.exp(-nearest[1] / width)
            why = f"{nearest[1]:.2f} m apart at step {nearest[0]}"
            for i, j in ((mine, theirs), (theirs, mine)):
                yield Move((i, j), (i, j), "crossing", _odds(wrong), why)
                yield Move((i,), (i, j), "crossing", _odds(wrong) - _ALONE, why)


def _odds(probability: float) -> float:
    return float(np.log(probability) - np.log1p(-probability))
