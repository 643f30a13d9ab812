"""The order of the review queue: the probability of a mistake, times the steps at stake."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from collections.abc import Sequence as Many
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.corrections import Correction, Place
from tracker.corrections.kinds import Kind, leeway
from tracker.fusion.trajectories import Trajectories
from tracker.review.queue import links, lost_people, single_tracks
from tracker.review.queue.clear_places import ClearPlaces
from tracker.review.queue.item import Alternative, ReviewItem, TrackRows, propose
from tracker.review.queue.meetings import meetings
from tracker.review.queue.moves import Move
from tracker.review.queue.other_run import OtherRun
from tracker.review.queue.track_ends import track_ends
from tracker.runs.run import Run

MOST = 200
"""Largest number of items of a queue; after so many answers it is computed again."""

_ALTERNATIVES = 4
"""Largest number of alternatives of an item, beside the run's own answer, the halves of an exchange
and "none of these": a list that can be looked through. With 1, and with all, 78 mistakes are
found."""

_HALF = 0.1
"""Probability of each half of an exchange, as a share of that of the exchange. With 0 and 0.2, 78
and 79 mistakes are found."""

LEAST = 1.0
"""Least expected number of wrong steps of an item that is worth a review. Halved, there are 419
items, doubled 183; the first fifteen have 84 and 76 mistakes, as some queues are shorter."""

_NEAR = 0.5
"""Distance within which a place of an item and a place of a correction count as the same, metres on
the ground: about a body's width."""

_ROUNDED = 1e-3
"""Largest difference between a place and its rounded coordinates in a correction, metres."""


@dataclass(frozen=True, slots=True)
class Queue:
    """The items to review."""

    items: tuple[ReviewItem, ...]
    """The items, in descending order of the expected number of wrong steps."""
    answered: int
    """The number of items that corrections have answered already."""
    how: str
    """The evidence that the items are based on, in words."""


_Satisfied = list[tuple[Kind, tuple[int, ...]]]
"""The kind and the ids of the tracks of corrections."""


def queue(
    run: Run,
    backwards: Trajectories | None = None,
    corrections: Many[Correction] | None = None,
) -> Queue:
    """Return the review queue of a run, without items that corrections have answered.

    Args:
        run: The run, complete or not.
        backwards: The tracks of a run backwards in time, if there is one.
        corrections: The corrections that answer items; the run's own if None.
    """
    made = run.corrections if corrections is None else corrections
    run = run.snapshot()
    track_rows = TrackRows(run.tracks)
    if not len(run.tracks):
        return Queue((), 0, "nobody is tracked")
    linked = list(_identity_items(run, track_rows, backwards))
    asked = {place for one in linked for place in one.places}
    found = [*linked, *single_tracks.items(run, track_rows), *track_ends(run, track_rows, asked)]
    ordered = sorted(found, key=lambda one: (-one.weight, one.first, one.id))
    steps = leeway(run.sequence.step_time)
    satisfied = _satisfied(run, made)
    parted, people = _parted_by(satisfied), _people(satisfied)
    items: list[ReviewItem] = []
    answered = 0
    for one in once_each(ordered):
        known = one.kind == "join" and parted(*one.tracks[:2])
        known = known or (one.kind == "short" and one.tracks[0] in people)
        if known or is_answered(one, made, steps):
            answered += 1
        elif len(items) < MOST:
            items.append(one)
    how = "the odds of joining pieces" if _joins(run) else "where tracks end and begin"
    if backwards is not None:
        how += ", and what the recording says seen backwards in time"
    how += f"; moments with less than {LEAST:.0f} expected wrong step are left out"
    return Queue(tuple(items), answered, how)


def _parted_by(applied: _Satisfied) -> Callable[[int, int], bool]:
    """Return a function that gets the ids of two tracks and returns whether corrections rule out
    their join: they state that these are different people, that the first left, or that the second
    came in."""
    parted = {frozenset(tracks) for kind, tracks in applied if kind == "different"}
    left = {track for kind, tracks in applied if kind == "left" for track in tracks}
    came = {track for kind, tracks in applied if kind == "came" for track in tracks}
    return lambda one, other: one in left or other in came or frozenset((one, other)) in parted


def _people(applied: _Satisfied) -> set[int]:
    """Return the ids of the tracks that corrections declare to be people."""
    kinds = ("here", "name", "came", "left", "same")
    return {track for kind, tracks in applied if kind in kinds for track in tracks}


def _satisfied(run: Run, corrections: Many[Correction]) -> _Satisfied:
    """Return the kind and the ids of the tracks of each of the corrections that the run
    satisfies."""
    kinds = {one.id: one.kind for one in corrections}
    return [(kinds[one.id], one.tracks) for one in run.outcomes if one.met and one.id in kinds]


def once_each(ordered: Iterable[ReviewItem]) -> Iterable[ReviewItem]:
    """Yield the items that are worth a review, without duplicates: an exchange is found for each of
    its two tracks, so that two items on the same two tracks count as one where their steps overlap.

    Args:
        ordered: The items, in descending order of the expected number of wrong steps.
    """
    known: set[object] = set()
    moments: dict[frozenset[int], list[tuple[int, int]]] = {}
    for one in ordered:
        same = frozenset(
            pair for made in one.alternatives[1].corrections for pair in made.constraints.must_link
        )
        if one.weight < LEAST or one.id in known or (same and same in known):
            continue
        if len(one.tracks) == 2:
            of_both = moments.setdefault(frozenset(one.tracks), [])
            if any(one.first <= last and first <= one.last for first, last in of_both):
                continue
            of_both.append((one.first, one.last))
        known |= {one.id, same}
        yield one


def _joins(run: Run) -> bool:
    """Whether the smoothing linked the tracklets of the run."""
    return run.smoothed is not None and run.smoothed.joined is not None


def _identity_items(
    run: Run, track_rows: TrackRows, backwards: Trajectories | None
) -> Iterable[ReviewItem]:
    """Yield the items on identities: all moves, grouped by the track and place that they change."""
    tracklets, joined = links.tracklets_of(run, track_rows)
    every: list[Move] = [] if joined is None else list(links.moves_of_links(tracklets, joined))
    known = {(move.earlier[0].end, move.later[-1].begin) for move in every}
    every += lost_people.joins_of_lost_people(run, track_rows, known)
    every += single_tracks.moves(run, track_rows)
    every += meetings(run, track_rows)
    step_time = run.sequence.step_time
    other = None if backwards is None else OtherRun(run.tracks, backwards, step_time)
    if other is not None:
        every += other.moves()
    clear = ClearPlaces(track_rows, step_time)
    every = [clear.move(move) for move in every]
    if other is not None:
        every = [other.with_evidence(move) for move in every]
    by_site: dict[tuple[int, Place], list[Move]] = {}
    for move in every:
        by_site.setdefault((move.earlier[0].track, move.earlier[0].end), []).append(move)
    sites = [_Site.of(moves) for moves in by_site.values()]
    reach = IdentityReach(
        track_rows,
        (
            (one.move.earlier[0].track, one.move.earlier[0].last,
             one.move.later[0].first, one.wrong)
            for one in sites
            if not one.move.joins
        ),
    )  # fmt: skip
    for one in sites:
        item = _item_of(run, one, reach)
        if item is not None:
            yield item


@dataclass(frozen=True, slots=True)
class _Site:
    """One moment of a track, and the moves by which it may be changed."""

    moves: tuple[Move, ...]
    """The moves, the most probable first, one for each set of corrections."""
    alternatives: tuple[Alternative, ...]
    """The alternative of each move, with its probability."""
    wrong: float
    """The probability that the run is wrong at this moment."""

    @property
    def move(self) -> Move:
        """The move that describes the item: the most probable one, or, if that is a cut, the most
        probable exchange if there is one, since it explains the cut."""
        best = self.moves[0]
        if best.kind != "cut":
            return best
        return next((one for one in self.moves if one.kind in ("exchange", "crossing")), best)

    @staticmethod
    def of(moves: list[Move]) -> _Site:
        """Combine the moves of several sources at one moment.

        Of the moves with the same corrections the most probable one counts. With the log odds l_k
        of the remaining moves, the probability of each is exp(l_k) / (1 + Σ exp(l)).
        """
        chosen: dict[object, Move] = {}
        for move in sorted(moves, key=lambda move: -move.log_odds):
            chosen.setdefault(move.alternative.corrections, move)
        kept = tuple(chosen.values())
        weights = np.exp(np.minimum([move.log_odds for move in kept], 50.0))
        total = 1.0 + float(weights.sum())
        alternatives = tuple(
            replace(move.alternative, probability=weight / total)
            for move, weight in zip(kept, weights.tolist(), strict=True)
        )
        return _Site(kept, alternatives, float(weights.sum()) / total)


def _item_of(run: Run, site: _Site, reach: IdentityReach) -> ReviewItem | None:
    """Return the item of a moment; None if no correction expresses any of its moves."""
    best = site.move
    now = Alternative("as it is", 1.0 - site.wrong, _as_it_is(best))
    others = [one for one in site.alternatives if one.corrections][:_ALTERNATIVES]
    others = [one for one in others if one.corrections != now.corrections]
    if not others:
        return None
    others = _with_none_of_them(best, now, _with_halves(site.moves, others))
    shares = np.array([one.probability for one in site.alternatives])
    stakes = [
        move.stake(
            [reach.before(one.track, one.last) for one in move.earlier],
            [reach.after(one.track, one.first) for one in move.later],
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
    """Add the halves of the most probable exchange, since one of two people who met may have
    left."""
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


def _with_none_of_them(
    move: Move, now: Alternative, others: list[Alternative]
) -> list[Alternative]:
    """Add the alternative that none of the tracks in question continues the person.

    The corrections of this alternative state that the person is different from each of them.
    """
    first, last = move.earlier[0].end, move.later[0].begin
    pairs = dict.fromkeys(
        (a, b)
        for one in (now, *others)
        for made in one.corrections
        for a, b in made.constraints.must_link
        if _is_rounded(a, first) or _is_rounded(b, last)
    )
    apart = [one for pair in pairs for one in propose("different", pair)]
    plain = [one for one in others if one.corrections and one.corrections[0].kind == "different"]
    chance = plain[0].probability if plain else 0.0
    rest = [one for one in others if one not in plain]
    if not apart:
        return others
    words = "two people" if len(apart) == 1 else "none of these"
    none = Alternative(words, chance, tuple(apart))
    return sorted([*rest, none], key=lambda one: -one.probability)


def _is_rounded(rounded: Place, place: Place) -> bool:
    """Whether the place of a correction, which is rounded, is the given place."""
    return rounded.step == place.step and bool(
        np.allclose(rounded.point, place.point, atol=_ROUNDED)
    )


def _as_it_is(move: Move) -> tuple[Correction, ...]:
    """Return the corrections that confirm the run's own links."""
    if move.joins:
        return propose("different", (move.earlier[0].end, move.later[0].begin))
    if len(move.earlier) == 2 and len(move.later) == 1:
        return propose("same", (move.earlier[0].end, move.later[0].begin))
    return tuple(
        one
        for i, j in zip(move.earlier, move.later, strict=False)
        for one in propose("same", (i.end, j.begin))
    )


def is_answered(item: ReviewItem, corrections: Many[Correction], steps: int) -> bool:
    """Whether a correction concerns the people of an item at its place and time.

    Args:
        item: The item.
        corrections: The corrections that were made.
        steps: Largest difference at which two steps count as the same, as a number of steps.
    """

    def near(one: Place, other: Place) -> bool:
        """Whether two places count as the same."""
        return (
            abs(one.step - other.step) <= steps
            and float(np.hypot(one.x - other.x, one.y - other.y)) <= _NEAR
        )

    for one in corrections:
        if one.kind in ("name", "checked"):
            if one.kind == "checked":
                first, last = one.steps
                if first <= item.first and item.last <= last:
                    return True
            continue
        for alternative in item.alternatives:
            for own in alternative.corrections:
                if own.kind in ("same", "different", "exchanged") and one.kind in (
                    "same", "different", "exchanged",
                ):  # fmt: skip
                    pairs = (*own.constraints.must_link, *own.constraints.cannot_link)
                    others = (*one.constraints.must_link, *one.constraints.cannot_link)
                    if any(near(a, c) and near(b, d) for a, b in pairs for c, d in others):
                        return True
                elif own.kind == one.kind and any(
                    near(a, c) for a in own.places for c in one.places
                ):
                    return True
    return False


class IdentityReach:
    """The expected number of steps of a track that have the same identity as a given step.

    With p_m the probability of a mistake at moment m, the expected number of steps r ≤ s that have
    the identity of step s is Σ_r Π_{m between r and s} (1 − p_m); the sum over r ≥ s holds for the
    steps after it. So the stake of a mistake is small right after another probable mistake.
    """

    def __init__(
        self, track_rows: TrackRows, mistakes: Iterable[tuple[int, int, int, float]]
    ) -> None:
        """Collect the probabilities of mistakes along each track.

        Args:
            track_rows: The tracks of the run.
            mistakes: The id of the track, the last step before and the first step after each
                possible mistake, and the probability of the mistake.
        """
        self._track_rows = track_rows
        self._kept: dict[int, Float[ndarray, " K"]] = {}
        for track, before, after, probability in mistakes:
            rows = track_rows.rows[track]
            kept = self._kept.setdefault(track, np.ones(len(rows)))
            frames = track_rows.tracks.frames[rows]
            at = int(np.searchsorted(frames, (before + after + 1) // 2))
            if 0 < at < len(rows):
                kept[at] *= 1.0 - probability

    def before(self, track: int, step: int) -> float:
        """Return the expected number of steps up to and including a step."""
        frames = self._track_rows.tracks.frames[self._track_rows.rows[track]]
        count = int(np.searchsorted(frames, step, side="right"))
        kept = self._kept.get(track)
        if kept is None or not count:
            return float(count)
        between = np.cumprod(kept[1:count][::-1])  # from the step backwards
        return 1.0 + float(between.sum())

    def after(self, track: int, step: int) -> float:
        """Return the expected number of steps from a step on, including it."""
        frames = self._track_rows.tracks.frames[self._track_rows.rows[track]]
        first = int(np.searchsorted(frames, step))
        kept = self._kept.get(track)
        if kept is None or first >= len(frames):
            return float(len(frames) - first)
        return 1.0 + float(np.cumprod(kept[first + 1 :]).sum())


def words_of(run: Run, move: Move) -> tuple[str, str]:
    """Return the title of a move's item, and the reason as a sentence without a full stop."""
    i, j = move.earlier[0], move.later[-1]
    far = _far(run, i.track, j.track, i.last, j.first)
    if move.title:
        return move.title, move.why
    if move.joins:
        title = f"Track {i.track} goes on as track {j.track}?"
        return title, f"track {i.track} ends and track {j.track} begins {far}"
    if move.kind == "cut":
        return f"Track {i.track} is two people?", f"after step {i.last} it goes on {far}"
    others = [one.track for one in (*move.earlier, *move.later) if one.track != i.track]
    if not others:
        title = f"Track {i.track} goes on elsewhere?"
        return title, f"another piece of track {i.track} fits, {far}"
    if i.track != j.track:
        return (
            f"Tracks {i.track} and {j.track} exchanged?",
            f"track {j.track} is where track {i.track} may have gone on, {far}",
        )
    other = others[0]
    return (
        f"Tracks {i.track} and {other} exchanged?",
        f"track {other} fits what track {i.track} does from step {j.first} on",
    )


def _far(run: Run, one: int, other: int, last: int, first: int) -> str:
    """Describe the distance of two tracklets in space and time.

    Args:
        run: The run.
        one: The id of the earlier track.
        other: The id of the later track.
        last: The last step of the earlier tracklet.
        first: The first step of the later tracklet.
    """
    tracks, ground = run.tracks, []
    for track, step in ((one, last), (other, first)):
        own = np.flatnonzero(tracks.ids == track)
        nearest = own[np.argmin(np.abs(tracks.frames[own] - step))]
        ground.append(tracks.positions[nearest, :2])
    metres = float(np.hypot(*(ground[1] - ground[0])))
    seconds = (first - last) * run.sequence.step_time
    away = "at the same place" if metres < 0.05 else f"{metres:.1f} m away"
    if seconds < 0.0:
        return f"{away}, {-seconds:.1f} s before that"
    return f"{away}, {seconds:.1f} s later"
