"""Which rows of a run's tracks rest on what a person said."""

from __future__ import annotations

from collections.abc import Sequence as Many

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.corrections.kinds import Correction
from tracker.corrections.outcomes import Outcome


def resting(
    frames: Int[ndarray, " N"],
    ids: Int[ndarray, " N"],
    positions: Float[ndarray, "N 3"],
    corrections: Many[Correction],
    outcomes: Many[Outcome],
) -> list[str]:
    """The id of the correction that each row rests on, empty for none.

    Whose a track is from a place on rests on what said so there, up to the next correction; where
    its people were not there for a while before the place, from where they come back. That
    somebody is at a place at all rests on *is here*. What is not met carries nothing.

    Args:
        frames: The step of each row.
        ids: The track of each.
        positions: World metres.
        corrections: In their order.
        outcomes: What became of them in these tracks.
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
                between = (ids == track) & (frames > earlier.step) & (frames <= place.step)
                begins.append((track, _back(frames[between], place.step), one.id))
    begins.sort(key=lambda begin: begin[1])
    for track, step, name in begins:
        for row in np.flatnonzero((ids == track) & (frames >= step)).tolist():
            found[row] = name
    return found


def _back(own: Int[ndarray, " K"], step: int) -> int:
    """The first step after the last gap among some steps; that of the place where there is none."""
    own = np.unique(own)
    gaps = np.flatnonzero(np.diff(own) > 1)
    return int(own[gaps[-1] + 1]) if len(gaps) else step
