"""Doubts about one track by itself."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

from tracker.corrections.kinds import KINDS
from tracker.review.queue.item import WITHIN, Alternative, Lanes, ReviewItem, proposed
from tracker.review.queue.linking import Move, Piece
from tracker.runs.run import Run

_SHORT = 1.0
"""Seconds of a track that may be nobody."""

_LONG = 5.0
"""Seconds after which few sights make nobody of it any more: so long clutter does not last."""

_UNSEEN = 1.0
"""Seconds for which no camera has somebody: a long miss."""

_FASTEST = 3.0
"""Metres a second that nobody in a room exceeds for long."""


def of_tracks(run: Run, lanes: Lanes) -> Iterator[ReviewItem]:
    """Who may be nobody."""
    for track in lanes.ids.tolist():
        yield from _nobody(run, lanes, track)


def moves(run: Run, lanes: Lanes) -> Iterator[Move]:
    """Where a track may go on as another person: it was gone, or jumps."""
    for track in lanes.ids.tolist():
        yield from _unseen(run, lanes, track)
        yield from _fast(run, lanes, track)


def _nobody(run: Run, lanes: Lanes, track: int) -> Iterator[ReviewItem]:
    """A short life, or one of few sights."""
    rows, tracks = lanes.rows[track], run.tracks
    life = len(rows) * run.sequence.step_time
    sights = tracks.seen[rows].sum(axis=1)
    cameras = int(tracks.seen[rows].any(axis=0).sum())
    existence = float(tracks.existences[rows].mean())
    seen = float((sights > 0).mean())
    one_alone = cameras == 1 and tracks.seen.shape[1] > 1
    wrong = (1.0 - min(existence, 1.0) * seen) * 0.6 * np.exp(-life / _LONG)
    wrong += 0.3 * np.exp(-life / _SHORT) + (0.2 if one_alone else 0.0)
    if wrong < 0.05:
        return
    first, last = lanes.span(track)
    places = lanes.course(rows, WITHIN * (KINDS["nobody"].accuracy or 0.0))
    wrong = float(min(wrong, 0.95))
    how = f"{life:.1f} s long, seen at {100 * seen:.0f} % of its steps"
    if one_alone:
        how += " by one camera alone"
    yield ReviewItem(
        "short", f"{track} is nobody?", how, first, last, (track,), (places[0], places[-1]),
        wrong, len(rows),
        (
            Alternative("as it is", 1.0 - wrong, proposed("same", (places[0], places[-1]))),
            Alternative("nobody", wrong, proposed("nobody", places)),
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


def _odds(probability: float) -> float:
    return float(np.log(probability) - np.log1p(-probability))
