"""Review items and moves that concern a single track: it may be clutter, or follow two people.

No run depends on the bounds of this module: they decide what a person is asked.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

from tracker.corrections.kinds import KINDS
from tracker.review.queue.item import WITHIN, Alternative, ReviewItem, TrackRows, propose
from tracker.review.queue.moves import Move, Tracklet
from tracker.runs.run import Run
from tracker.smoothing.tracklets.costs import FASTEST

_SHORT = 1.0
"""Time constant with which the probability that a track is clutter falls with the track's length,
seconds. Halved or doubled, 1 or 8 tracks are asked about instead of 2, and as many mistakes found.
"""

_LONG = 5.0
"""Time constant of the part of this probability that is due to few boxes, seconds. Halved or
doubled, 1 or 3 tracks are asked about instead of 2, and as many mistakes found."""

_FORGOTTEN = 5.0
"""Time constant with which the probability that a track follows another person after a gap grows
with the gap, seconds. Halved or doubled, 19 or 16 gaps are asked about instead of 18, and 79 or 80
mistakes are found."""

_UNSEEN = 1.0
"""Longest gap without a box of any camera for which no item is made, seconds. Halved or doubled, 42
or 11 gaps are asked about instead of 18, and 75 or 79 mistakes are found."""


def items(run: Run, track_rows: TrackRows) -> Iterator[ReviewItem]:
    """Yield an item for each track that may be clutter."""
    for track in track_rows.ids.tolist():
        yield from _clutter(run, track_rows, track)


def moves(run: Run, track_rows: TrackRows) -> Iterator[Move]:
    """Yield moves that cut a track where it may change to another person: at a gap or a jump."""
    for track in track_rows.ids.tolist():
        yield from _unseen(run, track_rows, track)
        yield from _fast(run, track_rows, track)


def _clutter(run: Run, track_rows: TrackRows, track: int) -> Iterator[ReviewItem]:
    """Yield an item if a track is short, or has few boxes.

    With its length t in seconds, its mean existence probability e and the share s of its steps with
    a box of any camera, the probability of clutter is

        0.6 (1 − e s) exp(−t / 5 s) + 0.3 exp(−t / 1 s) + 0.2 [boxes of one camera alone]

    of which the coefficients are estimates.
    """
    rows, tracks = track_rows.rows[track], run.tracks
    life = len(rows) * run.sequence.step_time
    boxes = tracks.seen[rows].sum(axis=1)
    cameras = int(tracks.seen[rows].any(axis=0).sum())
    existence = float(tracks.existences[rows].mean())
    seen = float((boxes > 0).mean())
    one_alone = cameras == 1 and tracks.seen.shape[1] > 1
    wrong = (1.0 - min(existence, 1.0) * seen) * 0.6 * np.exp(-life / _LONG)
    wrong += 0.3 * np.exp(-life / _SHORT) + (0.2 if one_alone else 0.0)
    if wrong < 0.05:
        return
    first, last = track_rows.span(track)
    places = track_rows.simplified_path(rows, WITHIN * (KINDS["nobody"].accuracy or 0.0))
    wrong = float(min(wrong, 0.95))
    how = f"{life:.1f} s long, seen at {100 * seen:.0f} % of its steps"
    if one_alone:
        how += " by one camera alone"
    yield ReviewItem(
        "short", f"Track {track} is nobody?", how, first, last, (track,), (places[0], places[-1]),
        wrong, len(rows),
        (
            Alternative("as it is", 1.0 - wrong, propose("same", (places[0], places[-1]))),
            Alternative("nobody", wrong, propose("nobody", places)),
        ),
    )  # fmt: skip


def _unseen(run: Run, track_rows: TrackRows, track: int) -> Iterator[Move]:
    """Yield moves at long gaps of a track, after which it may follow another person.

    After a gap of t seconds the probability of this is taken as 0.4 (1 − exp(−t / 5 s)), with
    :data:`_FORGOTTEN`; both numbers are estimates.
    """
    rows, tracks = track_rows.rows[track], run.tracks
    seen = np.flatnonzero(tracks.seen[rows].any(axis=1))
    for a, b in itertools.pairwise(seen):
        before, after = track_rows.of_row(int(rows[a])), track_rows.of_row(int(rows[b]))
        seconds = (after.step - before.step) * run.sequence.step_time
        if seconds <= _UNSEEN:
            continue
        title = f"Track {track} is gone for {seconds:.1f} s"
        why = f"no camera has it from step {before.step + 1} to {after.step - 1}"
        wrong = 0.4 * (1.0 - np.exp(-seconds / _FORGOTTEN))
        # stands for both tracklets: the earlier one ends before the cut, the later begins after it
        tracklet = Tracklet(track, begin=after, end=before)
        yield Move((tracklet,), (tracklet,), "gap", _log_odds(wrong), why, title)


def _fast(run: Run, track_rows: TrackRows, track: int) -> Iterator[Move]:
    """Yield moves where a track is faster than people walk.

    The probability of a jump is taken as 0.3 times the ratio of the speed to :data:`FASTEST`, and
    at most 0.9. With half of this speed 225 jumps are asked about instead of 11, and 68 mistakes
    are found; with twice 1 jump, and 80 mistakes.
    """
    rows, tracks = track_rows.rows[track], run.tracks
    frames, ground = tracks.frames[rows], tracks.positions[rows, :2]
    seconds = np.diff(frames) * run.sequence.step_time
    speed = np.linalg.norm(np.diff(ground, axis=0), axis=1) / np.maximum(seconds, 1e-9)
    fast = np.flatnonzero(speed > FASTEST)
    for k in fast[np.diff(fast, prepend=-9) > 1].tolist():
        before, after = track_rows.of_row(int(rows[k])), track_rows.of_row(int(rows[k + 1]))
        # stands for both tracklets: the earlier one ends before the cut, the later begins after it
        tracklet = Tracklet(track, begin=after, end=before)
        title = f"Track {track} jumps: {speed[k]:.1f} m/s at step {after.step}"
        log_odds = _log_odds(min(0.3 * speed[k] / FASTEST, 0.9))
        why = f"people walk at most {FASTEST:g} m/s"
        yield Move((tracklet,), (tracklet,), "fast", log_odds, why, title)


def _log_odds(probability: float) -> float:
    """Return log(p / (1 − p))."""
    return float(np.log(probability) - np.log1p(-probability))
