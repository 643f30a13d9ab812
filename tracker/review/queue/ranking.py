"""The doubtful places of a run in one order: how probable a mistake is, times what is at stake."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from collections.abc import Sequence as Many
from dataclasses import dataclass, replace

import numpy as np

from tracker.corrections import Correction, Place
from tracker.corrections.kinds import Kind, leeway
from tracker.fusion.trajectories import Trajectories
from tracker.review.queue import alone, moves
from tracker.review.queue.clear import Clear
from tracker.review.queue.edges import of_edges
from tracker.review.queue.item import Alternative, Lanes, ReviewItem, proposed
from tracker.review.queue.linking import Move
from tracker.review.queue.meetings import meetings
from tracker.review.queue.opinion import Opinion
from tracker.review.queue.trust import Trust
from tracker.review.queue.words import words_of
from tracker.runs.run import Run

MOST = 200
"""Doubtful places that are told; who has answered so many asks again."""

_ALTERNATIVES = 4
"""Told of each place, beside what the run has and what is never left out."""

_HALF = 0.1
"""Of the probability of an exchange, that only one of the two goes on as the other."""

LEAST = 1.0
"""Steps expected to be wrong, below which a place is not told: nobody needs to look."""

_SAME_MOMENT = 1.0
"""Seconds within which what is asked of the same two people is one place."""

_NEAR = 0.5
"""Metres on the ground within which a place that was answered is the same."""

_ROUNDED = 1e-3
"""Metres within which a place is the one that a correction was made of."""


@dataclass(frozen=True, slots=True)
class Queue:
    """What to look at."""

    doubts: tuple[ReviewItem, ...]
    """The most at stake first."""
    answered: int
    """Doubtful places that corrections settle already."""
    how: str
    """By what it was judged."""


def queue(
    run: Run,
    backwards: Trajectories | None = None,
    corrections: Many[Correction] | None = None,
) -> Queue:
    """The doubtful places of a run, but for those that its corrections settle.

    Args:
        run: With all its steps, or as far as it is.
        backwards: The tracks of the recording seen backwards in time, where that was made.
        corrections: By which a place is settled; those of the run, if none.
    """
    said = run.corrections if corrections is None else corrections
    run = run.still()
    lanes = Lanes(run.tracks)
    if not len(run.tracks):
        return Queue((), 0, "nobody is tracked")
    linked = list(_linked(run, lanes, backwards))
    asked = {place for one in linked for place in one.places}
    found = [*linked, *alone.of_tracks(run, lanes), *of_edges(run, lanes, asked)]
    ordered = sorted(found, key=lambda one: (-one.weight, one.first, one.id))
    steps = leeway(run.sequence.step_time)
    parted, somebody = _parted_by(run), _somebody(run)
    told: list[ReviewItem] = []
    answered = 0
    for one in once_each(ordered, round(_SAME_MOMENT / run.sequence.step_time)):
        known = one.kind == "join" and parted(*one.tracks[:2])
        known = known or (one.kind == "short" and one.tracks[0] in somebody)
        if known or settled(one, said, steps):
            answered += 1
        elif len(told) < MOST:
            told.append(one)
    how = "the odds of joining pieces" if _joins(run) else "where tracks end and begin"
    if backwards is not None:
        how += ", and what the recording says seen backwards in time"
    how += f"; less than {LEAST:.0f} step expected to be wrong is left out"
    return Queue(tuple(told), answered, how)


def _parted_by(run: Run) -> Callable[[int, int], bool]:
    """Whether somebody said that a track does not go on as another: that they are two people's,
    wherever along them, or that the one left or the other came in."""
    obeyed = _obeyed(run)
    parted = {frozenset(tracks) for kind, tracks in obeyed if kind == "different"}
    left = {track for kind, tracks in obeyed if kind == "left" for track in tracks}
    came = {track for kind, tracks in obeyed if kind == "came" for track in tracks}
    return lambda one, other: one in left or other in came or frozenset((one, other)) in parted


def _somebody(run: Run) -> set[int]:
    """The tracks of whom something was said that is said of people alone."""
    said = ("here", "name", "came", "left", "same")
    return {track for kind, tracks in _obeyed(run) if kind in said for track in tracks}


def _obeyed(run: Run) -> list[tuple[Kind | None, tuple[int, ...]]]:
    """Kind and tracks of each correction that is met."""
    kinds = {one.id: one.kind for one in run.corrections}
    return [(kinds.get(one.id), one.tracks) for one in run.outcomes if one.met]


def once_each(ordered: Iterable[ReviewItem], pause: int) -> Iterable[ReviewItem]:
    """What is worth a look, each place once: an exchange is found from either side.

    Args:
        ordered: The most at stake first.
        pause: Steps within which two moments of the same two people are one.
    """
    known: set[object] = set()
    moments: dict[frozenset[int], list[tuple[int, int]]] = {}
    for one in ordered:
        same = frozenset(pair for told in one.alternatives[1].corrections for pair in told.pairs)
        if one.weight < LEAST or one.id in known or (same and same in known):
            continue
        if len(one.tracks) == 2:
            of_both = moments.setdefault(frozenset(one.tracks), [])
            if any(one.first <= last + pause and first <= one.last + pause
                   for first, last in of_both):  # fmt: skip
                continue
            of_both.append((one.first, one.last))
        known |= {one.id, same}
        yield one


def _joins(run: Run) -> bool:
    return run.smoothed is not None and run.smoothed.joined is not None


def _linked(run: Run, lanes: Lanes, backwards: Trajectories | None) -> Iterable[ReviewItem]:
    """Doubts about who goes on as whom: the moves, gathered by the place they change."""
    pieces, joined = moves.pieces_of(run, lanes)
    every: list[Move] = [] if joined is None else list(moves.of_joining(pieces, joined))
    known = {(move.earlier[0].end, move.later[-1].begin) for move in every}
    every += moves.of_the_lost(run, lanes, known)
    every += alone.moves(run, lanes)
    every += meetings(run, lanes)
    step_time = run.sequence.step_time
    opinion = None if backwards is None else Opinion(run.tracks, backwards, step_time)
    if opinion is not None:
        every += opinion.moves()
    width = 2.0 * float(run.sequence.target_half_extents[:2].mean())
    clear = Clear(lanes, step_time, width)
    every = [clear.move(move) for move in every]
    if opinion is not None:
        every = [opinion.weighed(move) for move in every]
    by_site: dict[tuple[int, Place], list[Move]] = {}
    for move in every:
        by_site.setdefault((move.earlier[0].track, move.earlier[0].end), []).append(move)
    sites = [_Site.of(moves) for moves in by_site.values()]
    trust = Trust(
        lanes,
        (
            (one.move.earlier[0].track, one.move.earlier[0].last,
             one.move.later[0].first, one.wrong)
            for one in sites
            if not one.move.joins
        ),
    )  # fmt: skip
    for one in sites:
        doubt = _doubt_of(run, one, trust)
        if doubt is not None:
            yield doubt


@dataclass(frozen=True, slots=True)
class _Site:
    """One moment of a track, and the ways in which it may be otherwise."""

    moves: tuple[Move, ...]
    """The most probable first, one for each thing that may be said."""
    alternatives: tuple[Alternative, ...]
    wrong: float
    """Probability that it is otherwise."""

    @property
    def move(self) -> Move:
        """The one by which the moment is told: the most probable, but where that only says that a
        track is two people, the exchange that would explain it."""
        best = self.moves[0]
        if best.kind != "cut":
            return best
        return next((one for one in self.moves if one.kind in ("exchange", "crossing")), best)

    @staticmethod
    def of(moves: list[Move]) -> _Site:
        """What several sources say of one moment: of each way the one that thinks it likeliest."""
        chosen: dict[object, Move] = {}
        for move in sorted(moves, key=lambda move: -move.odds):
            chosen.setdefault(move.alternative.corrections, move)
        kept = tuple(chosen.values())
        weights = np.exp(np.minimum([move.odds for move in kept], 50.0))
        total = 1.0 + float(weights.sum())
        told = tuple(
            replace(move.alternative, probability=weight / total)
            for move, weight in zip(kept, weights.tolist(), strict=True)
        )
        return _Site(kept, told, float(weights.sum()) / total)


def _doubt_of(run: Run, site: _Site, trust: Trust) -> ReviewItem | None:
    best = site.move
    now = Alternative("as it is", 1.0 - site.wrong, _as_it_is(best))
    others = [one for one in site.alternatives if one.corrections][:_ALTERNATIVES]
    others = [one for one in others if one.corrections != now.corrections]
    if not others:
        return None
    others = _with_nobody_of_them(best, now, _with_halves(site.moves, others))
    shares = np.array([one.probability for one in site.alternatives])
    stakes = [
        move.stake(
            [trust.before(one.track, one.last) for one in move.earlier],
            [trust.after(one.track, one.first) for one in move.later],
        )
        for move in site.moves
    ]
    stake = round(float((shares * stakes).sum() / shares.sum()))
    places = (*(p.end for p in best.earlier), *(p.begin for p in best.later))
    tracks = tuple(dict.fromkeys(p.track for p in (*best.earlier, *best.later)))
    moments = (*(one.last for one in best.earlier), *(one.first for one in best.later))
    first, last = min(moments), max(moments)
    title, why = words_of(run, best)
    return ReviewItem(
        best.kind, title, why, first, last, tracks, places, site.wrong, stake, (now, *others)
    )


def _with_halves(moves: Iterable[Move], others: list[Alternative]) -> list[Alternative]:
    """The likeliest exchange also as each of its halves: of two who met, one may have left."""
    words = {move.alternative.corrections: move.halves for move in moves}
    for place, one in enumerate(others):
        if one.corrections[0].kind == "exchanged":
            known = [other.corrections for other in others]
            halves = [
                replace(half, probability=one.probability * _HALF)
                for half in words[one.corrections]
                if half.corrections and half.corrections not in known
            ]
            whole = replace(one, probability=one.probability * (1.0 - _HALF * len(halves)))
            return [*others[:place], whole, *others[place + 1 :], *halves]
    return others


def _with_nobody_of_them(
    move: Move, now: Alternative, others: list[Alternative]
) -> list[Alternative]:
    """Where people go on: that it is none of those who are told.

    Who says so parts somebody from everybody he may have been.
    """
    first, last = move.earlier[0].end, move.later[0].begin
    pairs = dict.fromkeys(
        (a, b)
        for one in (now, *others)
        for told in one.corrections
        for a, b in told.pairs
        if _is(a, first) or _is(b, last)
    )
    apart = [one for pair in pairs for one in proposed("different", pair)]
    plain = [one for one in others if one.corrections and one.corrections[0].kind == "different"]
    chance = plain[0].probability if plain else 0.0
    rest = [one for one in others if one not in plain]
    if not apart:
        return others
    words = "two people" if len(apart) == 1 else "none of these"
    none = Alternative(words, chance, tuple(apart))
    return sorted([*rest, none], key=lambda one: -one.probability)


def _is(said: Place, place: Place) -> bool:
    """Whether what is said is said of a place: a correction rounds it."""
    return said.step == place.step and bool(np.allclose(said.point, place.point, atol=_ROUNDED))


def _as_it_is(move: Move) -> tuple[Correction, ...]:
    """What somebody says who says that the run is right."""
    if move.joins:
        return proposed("different", (move.earlier[0].end, move.later[0].begin))
    if len(move.earlier) == 2 and len(move.later) == 1:
        return proposed("same", (move.earlier[0].end, move.later[0].begin))
    return tuple(
        one
        for i, j in zip(move.earlier, move.later, strict=False)
        for one in proposed("same", (i.end, j.begin))
    )


def settled(doubt: ReviewItem, corrections: Many[Correction], steps: int) -> bool:
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
