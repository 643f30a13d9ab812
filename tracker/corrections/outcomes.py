"""Outcomes of corrections in a run: whether each is met, and which rows depend on it."""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.corrections.kinds import Correction, Place
from tracker.corrections.lookup import TrackIndex, mostly_inside

_GATE = 3.0
"""Distance within which a track is at the place of a correction, in standard deviations of the
place: 99 % of the places of two Gaussian coordinates are within it."""

_IDENTITY_KINDS = ("same", "different", "exchanged")
"""The kinds about identity, which may contradict an unmet correction."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """The outcome of one correction in one run."""

    id: str
    """Identifier of the correction."""
    met: bool
    """Whether the tracks meet the correction."""
    why: str = ""
    """Why the correction is not met, in one sentence; empty if it is met."""
    tracks: tuple[int, ...] = ()
    """Ids of the tracks that the correction refers to, in the order of its places; empty if one of
    them is missing."""


class _NotFound(Exception):
    """A place of a correction refers to no track."""


class _Tracks:
    """The tracks of a run with an index of their rows, for corrections whose tracks must exist."""

    def __init__(self, frames: ndarray, ids: ndarray, positions: ndarray, leeway: int) -> None:
        """Index the tracks, with the arguments of :func:`outcomes`."""
        self.frames, self.ids, self.leeway = frames, ids, leeway
        self.index = TrackIndex(frames, positions, ids)
        self.positions = positions

    def track_at(self, place: Place) -> int:
        """Return the id of the track that a place refers to, or raise :class:`_NotFound`."""
        row = self.row_at(place)
        return int(self.ids[row])

    def row_at(self, place: Place) -> int:
        """Return the row that a place refers to, or raise :class:`_NotFound`."""
        row = self.index.nearest(place, leeway=self.leeway)
        if row is None:
            raise _NotFound(f"found nobody near {place.words}")
        return row


def outcomes(
    frames: Int[ndarray, " N"],
    ids: Int[ndarray, " N"],
    positions: Float[ndarray, "N 3"],
    corrections: Many[Correction],
    *,
    leeway: int,
) -> tuple[Outcome, ...]:
    """Determine the outcome of each correction in the tracks of a run.

    Args:
        frames: Step of each of N rows.
        ids: Track of each row.
        positions: Position of each row, world metres.
        corrections: The corrections of the run.
        leeway: Number of steps by which a track may miss the step of a place, and by which it may
            begin before *came* or end after *left*.
    """
    tracks = _Tracks(frames, ids, positions, leeway)
    found = []
    for one in corrections:
        try:
            concerned, why = _check(tracks, one)
        except _NotFound as error:
            found.append(Outcome(one.id, False, str(error)))
        else:
            found.append(Outcome(one.id, not why, why, concerned))
    both = list(zip(corrections, found, strict=True))
    holds = [pair for pair in both if pair[1].met and pair[0].kind in _IDENTITY_KINDS]
    return tuple(
        outcome if outcome.met else _with_reason(one, outcome, holds) for one, outcome in both
    )


def _with_reason(
    own: Correction, unmet: Outcome, holds: Many[tuple[Correction, Outcome]]
) -> Outcome:
    """Add to the reason of an unmet correction the last met one about the same tracks and steps.

    Args:
        own: The unmet correction.
        unmet: The outcome of ``own``.
        holds: Met corrections of identity and their outcomes.
    """
    if own.kind == "here":
        return unmet
    first, last = own.steps
    for other, outcome in reversed(holds):
        begin, end = other.steps
        if first <= end and begin <= last and set(outcome.tracks) & set(unmet.tracks):
            return replace(unmet, why=f'{unmet.why}; "{other.words}" holds there')
    return unmet


def _check(tracks: _Tracks, one: Correction) -> tuple[tuple[int, ...], str]:
    """Return the tracks that a correction refers to, and the reason why it is not met, else ""."""
    if one.kind == "checked":
        return (), ""
    if one.kind == "nobody":
        inside = tracks.index.inside(one)
        rest = mostly_inside(tracks.ids, tracks.frames, inside, one)
        return tuple(rest), "somebody is still tracked there" if rest else ""
    if one.kind == "here":
        return _here(tracks, one)
    ids = tuple(tracks.track_at(place) for place in one.places)
    if one.kind == "same" and ids[0] != ids[1]:
        return ids, f"they are two tracks, {ids[0]} and {ids[1]}"
    if one.kind == "different" and ids[0] == ids[1]:
        return ids, f"they are one track, {ids[0]}"
    if one.kind == "exchanged" and ids[:2] != ids[2:]:
        if len(set(ids[:2])) < 2 or len(set(ids[2:])) < 2:
            return ids, "only one of the two is there"
        return ids, f"{ids[0]} and {ids[1]} go on as {ids[2]} and {ids[3]}"
    if one.kind in ("came", "left"):
        row = tracks.row_at(one.places[0])
        before = one.kind == "came"
        step = one.places[0].step + (-1 if before else 1) * (tracks.leeway + 1)
        # a track up to the end of the recording, or from its beginning, has not left or come
        step = min(max(step, 0), int(tracks.frames.max()))
        own = tracks.frames[tracks.ids == ids[0]]
        between = own[(own - step) * (own - tracks.frames[row]) <= 0]
        long = min(abs(one.places[0].step - step), tracks.leeway)
        if long and step in own and len(between) > long:
            return ids, f"track {ids[0]} is there {'before' if before else 'after'} it"
    return ids, ""


def _here(tracks: _Tracks, one: Correction) -> tuple[tuple[int, ...], str]:
    """Check a correction of kind ``here``, as :func:`_check`."""
    place = one.places[0]
    row = tracks.index.nearest(place)
    if row is None:
        return (), f"found nobody near {place.words}"
    apart = float(np.hypot(*(tracks.positions[row, :2] - [place.x, place.y])))
    accuracy = one.accuracy or 0.0
    if apart > _GATE * accuracy:
        return (int(tracks.ids[row]),), (
            f"the nearest is {apart:.2f} m from it, and it is said to be right to {accuracy:g} m"
        )
    return (int(tracks.ids[row]),), ""


def names_by_track(outcomes: Many[Outcome], corrections: Many[Correction]) -> dict[int, str]:
    """The names of tracks by their ids; the later of two names of one track.

    Outcomes of corrections that are not among ``corrections``, such as one just undone, are left
    out.
    """
    names = {one.id: one.name for one in corrections}
    return {
        outcome.tracks[0]: name
        for outcome in outcomes
        if outcome.met and (name := names.get(outcome.id)) is not None
    }


def supporting_corrections(
    frames: Int[ndarray, " N"],
    ids: Int[ndarray, " N"],
    corrections: Many[Correction],
    outcomes: Many[Outcome],
) -> list[str]:
    """Return the id of the correction that each row of tracks depends on, empty for none.

    The identity of a track depends on a correction of identity from its later place on, or from the
    end of the gap before that place, up to the next correction. A row at the place of a correction
    of kind ``here`` depends on that correction. Unmet corrections are left out.

    Args:
        frames: Step of each of N rows.
        ids: Track of each row.
        corrections: The corrections in the order in which they were made.
        outcomes: The outcomes of the corrections in these tracks.
    """
    by_id = {one.id: one for one in corrections}
    found = [""] * len(frames)
    begins: list[tuple[int, int, str]] = []
    for outcome in outcomes:
        one = by_id.get(outcome.id)
        if one is None or not outcome.met:
            continue
        if one.kind == "here":
            own = np.flatnonzero((frames == one.places[0].step) & (ids == outcome.tracks[0]))
            for row in own.tolist():
                found[row] = one.id
        later = {"same": 1, "different": 1, "exchanged": 2}.get(one.kind)
        if later is not None:
            pairs = zip(one.places, one.places[later:], outcome.tracks[later:], strict=False)
            for earlier, place, track in pairs:
                between = (ids == track) & (frames >= earlier.step) & (frames <= place.step)
                begins.append((track, _after_last_gap(frames[between], place.step), one.id))
    begins.sort(key=lambda begin: begin[1])
    for track, step, name in begins:
        for row in np.flatnonzero((ids == track) & (frames >= step)).tolist():
            found[row] = name
    return found


def _after_last_gap(own: Int[ndarray, " K"], step: int) -> int:
    """The first step after the last gap among some steps; ``step`` where there is no gap."""
    own = np.unique(own)
    gaps = np.flatnonzero(np.diff(own) > 1)
    return int(own[gaps[-1] + 1]) if len(gaps) else step
