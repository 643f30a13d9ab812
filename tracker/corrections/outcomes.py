"""Whether a run meets its corrections, and where it does not, why."""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.corrections.kinds import Correction, Place
from tracker.corrections.seeking import Whereabouts, mostly_inside

_GATE = 3.0
"""Standard deviations of a stated place within which somebody is at it."""


_WHO = ("same", "different", "exchanged")
"""The kinds that say who is who, and may stand against another sentence."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of one correction in one run."""

    id: str
    """Of the correction."""
    met: bool
    why: str = ""
    """Where it is not: in one sentence."""
    tracks: tuple[int, ...] = ()
    """The ids of whom it means, in the order of its places; as far as they are found."""


class _Nobody(Exception):
    """A correction no longer finds its people."""


class _Tracks:
    def __init__(self, frames: ndarray, ids: ndarray, positions: ndarray, leeway: int) -> None:
        self.frames, self.ids, self.leeway = frames, ids, leeway
        self.whereabouts = Whereabouts(frames, positions, ids)
        self.positions = positions

    def who(self, place: Place) -> int:
        row = self.row(place)
        return int(self.ids[row])

    def row(self, place: Place) -> int:
        row = self.whereabouts.nearest(place, leeway=self.leeway)
        if row is None:
            raise _Nobody(f"found nobody near {place.words}")
        return row


def outcomes(
    frames: Int[ndarray, " N"],
    ids: Int[ndarray, " N"],
    positions: Float[ndarray, "N 3"],
    corrections: Many[Correction],
    *,
    leeway: int,
) -> tuple[Outcome, ...]:
    """What became of each correction in a run's tracks.

    Args:
        frames: The step of each row.
        ids: The track of each.
        positions: World metres.
        corrections: Those of the run.
        leeway: Steps within which somebody counts as meant who is not there at the very step, and
            within which who came or left is not there.
    """
    tracks = _Tracks(frames, ids, positions, leeway)
    found = []
    for one in corrections:
        try:
            who, why = _looked(tracks, one)
        except _Nobody as nobody:
            found.append(Outcome(one.id, False, str(nobody)))
        else:
            found.append(Outcome(one.id, not why, why, who))
    both = list(zip(corrections, found, strict=True))
    holds = [pair for pair in both if pair[1].met and pair[0].kind in _WHO]
    return tuple(outcome if outcome.met else _against(one, outcome, holds) for one, outcome in both)


def _against(own: Correction, unmet: Outcome, holds: Many[tuple[Correction, Outcome]]) -> Outcome:
    """With the sentence that stands against one that is not met: the last that holds of the same
    people and steps."""
    if own.kind == "here":
        return unmet
    first, last = own.steps
    for other, outcome in reversed(holds):
        begin, end = other.steps
        if first <= end and begin <= last and set(outcome.tracks) & set(unmet.tracks):
            return replace(unmet, why=f'{unmet.why}; "{other.words}" holds there')
    return unmet


def _looked(tracks: _Tracks, one: Correction) -> tuple[tuple[int, ...], str]:
    """Whom it means, and why it is not met; empty where it is."""
    if one.kind == "checked":
        return (), ""
    if one.kind == "nobody":
        inside = tracks.whereabouts.inside(one)
        rest = mostly_inside(tracks.ids, tracks.frames, inside, one)
        return tuple(rest), "somebody is still tracked there" if rest else ""
    if one.kind == "here":
        return _here(tracks, one)
    who = tuple(tracks.who(place) for place in one.places)
    if one.kind == "same" and who[0] != who[1]:
        return who, f"they are two tracks, {who[0]} and {who[1]}"
    if one.kind == "different" and who[0] == who[1]:
        return who, f"they are one track, {who[0]}"
    if one.kind == "exchanged" and who[:2] != who[2:]:
        if len(set(who[:2])) < 2 or len(set(who[2:])) < 2:
            return who, "only one of the two is there"
        return who, f"{who[0]} and {who[1]} go on as {who[2]} and {who[3]}"
    if one.kind in ("came", "left"):
        row = tracks.row(one.places[0])
        before = one.kind == "came"
        step = one.places[0].step + (-1 if before else 1) * (tracks.leeway + 1)
        # Who is there at the recording's very end, or from its beginning on, has not left or come.
        step = min(max(step, 0), int(tracks.frames.max()))
        own = tracks.frames[tracks.ids == who[0]]
        between = own[(own - step) * (own - tracks.frames[row]) <= 0]
        long = min(abs(one.places[0].step - step), tracks.leeway)
        if long and step in own and len(between) > long:
            return who, f"track {who[0]} is there {'before' if before else 'after'} it"
    return who, ""


def _here(tracks: _Tracks, one: Correction) -> tuple[tuple[int, ...], str]:
    place = one.places[0]
    row = tracks.whereabouts.nearest(place)
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
    """The names that people were given, by track; of two for one track the later.

    Outcomes of corrections that are not among these, as of one that was just dropped, name nobody.
    """
    names = {one.id: one.name for one in corrections}
    return {
        outcome.tracks[0]: name
        for outcome in outcomes
        if outcome.met and (name := names.get(outcome.id)) is not None
    }
