"""Doubts about one track by itself, and about two people who come close."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

from tracker.doubts.doubt import Alternative, Doubt, Lanes, unsaid
from tracker.runs.run import Run

_SHORT = 1.0
"""Seconds of a track that may be nobody."""

_UNSEEN = 1.0
"""Seconds for which no camera has somebody: a long miss."""

_CLOSE = 2.0
"""Target widths within which two people are close."""

_FASTEST = 3.0
"""Metres a second that nobody in a room exceeds for long."""


def of_tracks(run: Run, lanes: Lanes) -> Iterator[Doubt]:
    """All of them."""
    for track in lanes.ids.tolist():
        yield from _nobody(run, lanes, track)
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


def _unseen(run: Run, lanes: Lanes, track: int) -> Iterator[Doubt]:
    """Long misses within a life: who comes back may be somebody else."""
    rows, tracks = lanes.rows[track], run.tracks
    seen = np.flatnonzero(tracks.seen[rows].any(axis=1))
    for a, b in itertools.pairwise(seen):
        before, after = lanes.of_row(int(rows[a])), lanes.of_row(int(rows[b]))
        seconds = (after.step - before.step) * run.sequence.step_time
        if seconds <= _UNSEEN:
            continue
        wrong = float(0.4 * (1.0 - np.exp(-seconds / 5.0)))
        stake = min(lanes.count(track, 0, before.step), lanes.count(track, after.step))
        yield Doubt(
            "gap", f"{track} is gone for {seconds:.1f} s",
            f"no camera has it from step {before.step + 1} to {after.step - 1}",
            before.step, after.step, (track,), (before, after), wrong, stake,
            (
                Alternative("as it is", 1.0 - wrong, unsaid("same", (before, after))),
                Alternative("two people", wrong, unsaid("different", (before, after))),
            ),
        )  # fmt: skip


def _fast(run: Run, lanes: Lanes, track: int) -> Iterator[Doubt]:
    """Where it goes faster than anybody."""
    rows, tracks = lanes.rows[track], run.tracks
    frames, ground = tracks.frames[rows], tracks.positions[rows, :2]
    seconds = np.diff(frames) * run.sequence.step_time
    speed = np.linalg.norm(np.diff(ground, axis=0), axis=1) / np.maximum(seconds, 1e-9)
    fast = np.flatnonzero(speed > _FASTEST)
    for k in fast[np.diff(fast, prepend=-9) > 1].tolist():
        before, after = lanes.of_row(int(rows[k])), lanes.of_row(int(rows[k + 1]))
        stake = min(k + 1, len(rows) - k - 1)
        wrong = float(min(0.3 * speed[k] / _FASTEST, 0.9))
        yield Doubt(
            "fast", f"{track} jumps", f"{speed[k]:.1f} m/s at step {after.step}",
            before.step, after.step, (track,), (before, after), wrong, stake,
            (
                Alternative("as it is", 1.0 - wrong, unsaid("same", (before, after))),
                Alternative("two people", wrong, unsaid("different", (before, after))),
            ),
        )  # fmt: skip


def _close(run: Run, lanes: Lanes) -> Iterator[Doubt]:
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
            before = [lanes.place(track, first) for track in (one, other)]
            after = [lanes.place(track, last, after=True) for track in (one, other)]
            if max(p.step for p in before) >= min(p.step for p in after):
                continue
            heads = [lanes.count(track, 0, first) for track in (one, other)]
            tails = [lanes.count(track, last) for track in (one, other)]
            if not min(heads) + min(tails):
                continue
            wrong = float(0.12 * np.exp(-nearest[1] / width))
            told = unsaid("exchanged", (before[0], before[1], after[1], after[0]))
            now = (
                *unsaid("same", (before[0], after[0])), *unsaid("same", (before[1], after[1])),
            )  # fmt: skip
            if not told:
                continue
            yield Doubt(
                "crossing", f"{one} and {other} pass closely",
                f"{nearest[1]:.2f} m apart at step {nearest[0]}",
                first, last, (one, other), (*before, *after), wrong,
                min(sum(heads), sum(tails)),
                (Alternative("as it is", 1.0 - wrong, now), Alternative("exchanged", wrong, told)),
            )  # fmt: skip
