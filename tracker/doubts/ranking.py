"""The doubtful places of a run in one order: how probable a mistake is, times what is at stake."""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Sequence as Many
from dataclasses import dataclass, replace

import numpy as np

from tracker.corrections import Correction, Place
from tracker.corrections.kinds import leeway
from tracker.doubts import moves
from tracker.doubts.alone import of_tracks
from tracker.doubts.doubt import Alternative, Doubt, Lanes, unsaid
from tracker.doubts.linking import Move
from tracker.doubts.opinion import Opinion
from tracker.runs.run import Run
from tracker.trajectories import Trajectories

MOST = 200
"""Doubtful places that are told; who has answered so many asks again."""

_ALTERNATIVES = 4
"""Told of each place, beside what the run has."""

_LEAST = 0.5
"""Steps expected to be wrong, below which nobody needs to look."""

_NEAR = 0.5
"""Metres on the ground within which a place that was answered is the same."""


@dataclass(frozen=True, slots=True)
class Queue:
    """What to look at."""

    doubts: tuple[Doubt, ...]
    """The most at stake first."""
    answered: int
    """Doubtful places that corrections settle already."""
    how: str
    """By what it was judged."""


def queue(run: Run, backwards: Trajectories | None = None) -> Queue:
    """The doubtful places of a run, but for those that its corrections settle.

    Args:
        run: With all its steps, or as far as it is.
        backwards: The tracks of the recording seen backwards in time, where that was made.
    """
    lanes = Lanes(run.tracks)
    if not len(run.tracks):
        return Queue((), 0, "nobody is tracked")
    found = [*_linked(run, lanes, backwards), *of_tracks(run, lanes)]
    ordered = sorted(found, key=lambda one: (-one.weight, one.first, one.id))
    seen: set[object] = set()
    told: list[Doubt] = []
    answered = 0
    steps = leeway(run.sequence.step_time)
    for one in ordered:
        same = frozenset(pair for told in one.alternatives[1].corrections for pair in told.pairs)
        if one.weight < _LEAST or one.id in seen or (same and same in seen):
            continue  # an exchange is found from either side
        seen |= {one.id, same}
        if settled(one, run.corrections, steps):
            answered += 1
        elif len(told) < MOST:
            told.append(one)
    how = "the odds of joining pieces" if _joins(run) else "where tracks end and begin"
    if backwards is not None:
        how += ", and what the recording says seen backwards in time"
    return Queue(tuple(told), answered, how)


def _joins(run: Run) -> bool:
    return run.smoothed is not None and run.smoothed.joined is not None


def _linked(run: Run, lanes: Lanes, backwards: Trajectories | None) -> Iterable[Doubt]:
    """Doubts about who goes on as whom: the moves, gathered by the place they change."""
    pieces, joined = moves.pieces_of(run, lanes)
    every: list[Move] = [] if joined is None else list(moves.of_joining(pieces, joined))
    known = {(move.earlier[0].end, move.later[-1].begin) for move in every}
    every += moves.of_the_lost(run, lanes, known)
    if backwards is not None:
        opinion = Opinion(run.tracks, backwards, run.sequence.step_time)
        every = [opinion.weighed(move) for move in [*every, *opinion.moves()]]
    by_site: dict[tuple[str, Place], list[Move]] = {}
    for move in every:
        for site in _sites(move):
            by_site.setdefault(site, []).append(move)
    for options in by_site.values():
        options.sort(key=lambda move: -move.odds)
        doubt = _doubt_of(run, options)
        if doubt is not None:
            yield doubt


def _sites(move: Move) -> set[tuple[str, Place]]:
    """The ends and begins that a move links otherwise."""
    return {("end", move.earlier[0].end)}


def _doubt_of(run: Run, options: list[Move]) -> Doubt | None:
    odds = np.array([move.odds for move in options])
    weights = np.exp(np.minimum(odds, 50.0))
    total = 1.0 + float(weights.sum())
    wrong = float(weights.sum()) / total
    best = options[0]
    others: list[Alternative] = []
    for move, weight in zip(options, weights.tolist(), strict=True):
        told = move.alternative
        if told.corrections and all(told.corrections != one.corrections for one in others):
            others.append(replace(told, probability=weight / total))
        if len(others) == _ALTERNATIVES:
            break
    if not others:
        return None
    stake = round(float((weights * [move.stake for move in options]).sum() / weights.sum()))
    now = Alternative("as it is", 1.0 / total, _as_it_is(best))
    places = (*(p.end for p in best.earlier), *(p.begin for p in best.later))
    tracks = tuple(dict.fromkeys(p.track for p in (*best.earlier, *best.later)))
    first, last = min(p.step for p in places), max(p.step for p in places)
    title, why = _words(run, best, tracks)
    return Doubt(best.kind, title, why, first, last, tracks, places, wrong, stake, (now, *others))


def _as_it_is(move: Move) -> tuple[Correction, ...]:
    """What somebody says who says that the run is right."""
    if move.kind == "join":
        return unsaid("different", (move.earlier[0].end, move.later[0].begin))
    if len(move.earlier) == 2 and len(move.later) == 1:
        return unsaid("same", (move.earlier[0].end, move.later[0].begin))
    return tuple(
        one
        for i, j in zip(move.earlier, move.later, strict=False)
        for one in unsaid("same", (i.end, j.begin))
    )


def _words(run: Run, move: Move, tracks: tuple[int, ...]) -> tuple[str, str]:
    i, j = move.earlier[0], move.later[-1]
    seconds = (j.begin.step - i.end.step) * run.sequence.step_time
    apart = float(np.hypot(j.begin.x - i.end.x, j.begin.y - i.end.y))
    far = f"{apart:.1f} m away, {seconds:.1f} s later"
    if move.kind == "join":
        return (
            f"{i.track} goes on as {j.track}?",
            f"{i.track} ends and {j.track} begins {far}",
        )
    if move.kind == "cut":
        return (
            f"{i.track} is two people?",
            f"before and after step {i.end.step} fit {apart:.1f} m apart over {seconds:.1f} s",
        )
    if len(tracks) > 1:
        return (
            f"{tracks[0]} and {tracks[1]} exchanged?",
            f"{j.track} begins where {i.track} may go on, {far}",
        )
    return f"{i.track} goes on elsewhere?", f"another piece of it fits, {far}"


def settled(doubt: Doubt, corrections: Many[Correction], steps: int) -> bool:
    """Whether what somebody said speaks of the people of a doubtful place there.

    Args:
        doubt: The place.
        corrections: What was said.
        steps: Within which a step is the same.
    """

    def near(one: Place, other: Place) -> bool:
        return (
            abs(one.step - other.step) <= steps
            and float(np.hypot(one.x - other.x, one.y - other.y)) <= _NEAR
        )

    for one in corrections:
        if one.kind in ("name", "checked"):
            if one.kind == "checked":
                first, last = one.steps
                if first <= doubt.first and doubt.last <= last:
                    return True
            continue
        for alternative in doubt.alternatives:
            for own in alternative.corrections:
                if own.kind in ("same", "different", "exchanged") and one.kind in (
                    "same", "different", "exchanged",
                ):  # fmt: skip
                    pairs = (*own.pairs, *own.apart)
                    theirs = (*one.pairs, *one.apart)
                    if any(near(a, c) and near(b, d) for a, b in pairs for c, d in theirs):
                        return True
                elif own.kind == one.kind and any(
                    near(a, c) for a in own.places for c in one.places
                ):
                    return True
    return False
