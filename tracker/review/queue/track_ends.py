"""Review items of tracks that begin or end inside the room, and of people without a track.

No run depends on the bounds of this module: they decide what a person is asked.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.corrections import Correction, Place
from tracker.corrections.kinds import leeway
from tracker.review.queue.item import Alternative, ReviewItem, TrackRows, propose
from tracker.review.queue.lost_people import leaving_probability
from tracker.review.queue.unclaimed import Unclaimed, find_unclaimed
from tracker.runs.run import Run

_MISSED = 0.3
"""Probability that a camera has no box for a while of a person in its picture. Halved, no end of a
track is asked about instead of 25, and 79 mistakes are found; doubled 46 ends and 7 beginnings, and
78 mistakes."""

_WALK = 1.0
"""Speed at which a missed person is assumed to walk from an entrance or side of the room, metres
per second. Halved, 37 ends and 3 beginnings are asked about, and 74 mistakes are found; doubled 7
ends, and 79 mistakes."""

_ASIDE = 0.5
"""Time before a track begins, or after it ends, at which the person may have been there without a
track, seconds. Halved it changes no item; doubled, 3 ends fewer are asked about."""

_ACCURACY = 0.3
"""Standard deviation of the place of a missing person in the proposed corrections, metres. Of
158 places in three random crowds nine tenths err by at most 0.12 m; one in twenty is off by more
than 1.4 m, where boxes of two people meet."""

# Of 284 people who are missing, since tracks were cut or taken out in three random crowds, in two
# rooms that people leave, and in two recordings, 208 are.
_APART = 1.0
"""Least time between two places of a proposed path of a missing person, seconds. With it 207
of the items can be answered truthfully, halved 201 and doubled 205."""

_MOST_PLACES = 12
"""Largest number of places of a proposed path, each of which becomes a correction. With 2, 204 can
be answered; from 6 on 207."""


def track_ends(run: Run, track_rows: TrackRows, asked: Collection[Place]) -> Iterator[ReviewItem]:
    """Yield items for missing people, then for tracks that begin or end in the middle of the room.

    Let q be the prior probability that people neither come nor leave at a place, n the number of
    cameras in whose pictures the person would have been a little earlier (or later), at the place
    extrapolated from the track, and m the probability that one camera misses a person. Then the
    odds that the person was there are q m^n / (1 − q).

    Args:
        run: The run.
        track_rows: The run's tracks.
        asked: The first and last places of tracks that items of other sources concern, for which
            no item is made here.
    """
    yield from (_missing(run, one) for one in find_unclaimed(run))
    near = leeway(run.sequence.step_time)
    for track in track_rows.ids.tolist():
        rows = track_rows.rows[track]
        first, last = track_rows.of_row(int(rows[0])), track_rows.of_row(int(rows[-1]))
        if first.step > near and first not in asked:
            yield from _edge(run, track_rows, track, before=True)
        if run.complete and last.step < run.sequence.frames - 1 - near and last not in asked:
            yield from _edge(run, track_rows, track, before=False)


def _missing(run: Run, one: Unclaimed) -> ReviewItem:
    """Return the item of a person that unclaimed boxes show.

    Boxes of n cameras that agree on a share s of the steps of t seconds are of a person with the
    probability 0.8 s (1 − exp(−t (n − 1) / 1 s)), of which the numbers are estimates.

    Args:
        run: The run.
        one: The person.
    """
    seconds = len(one.places) * run.sequence.step_time
    wrong = float(0.8 * one.share * -np.expm1(-seconds * (len(one.cameras) - 1)))
    pause = max(round(_APART / run.sequence.step_time), 1)
    first, last = one.places[0], one.places[-1]
    spread = np.linspace(0, len(one.places) - 1, min(max((last.step - first.step) // pause, 2),
                                                     _MOST_PLACES, len(one.places)))  # fmt: skip
    along = [one.places[k] for k in np.unique(spread.round().astype(int)).tolist()]
    names = [run.sequence.cameras[number].name for number in one.cameras]
    listed = f"{', '.join(names[:-1])} and {names[-1]}"
    here: tuple[Correction, ...] = tuple(
        one for place in along for one in propose("here", (place,), accuracy=_ACCURACY)
    )
    return ReviewItem(
        "missing", "Somebody is missing?",
        f"boxes of {listed} meet for {seconds:.1f} s where nobody is tracked",
        first.step, last.step, (), tuple(along), wrong, last.step - first.step + 1,
        (
            Alternative("nobody", 1.0 - wrong, propose("nobody", along)),
            Alternative("somebody", wrong, here),
        ),
    )  # fmt: skip


def _edge(run: Run, track_rows: TrackRows, track: int, *, before: bool) -> Iterator[ReviewItem]:
    """Yield the item of a track that begins or ends inside the room, in view of a camera."""
    sequence = run.sequence
    rows = track_rows.rows[track]
    stride = max(round(_ASIDE / sequence.step_time), 1)
    if len(rows) <= stride:
        return  # so short that there is an item on whether it is clutter
    at, inner = (rows[0], rows[stride]) if before else (rows[-1], rows[-1 - stride])
    place, point = track_rows.of_row(int(at)), track_rows.tracks.positions[at]
    beyond = 2.0 * point - track_rows.tracks.positions[inner]
    beyond[2] = point[2]
    if not sequence.room.contains(beyond[None])[0]:
        return
    cameras = sum(bool(camera.sees(beyond[None])[0]) for camera in sequence.cameras)
    if not cameras:
        return  # no camera sees the place
    comes = leaving_probability(place, run)
    odds = (1.0 - comes) / comes * _MISSED**cameras
    wrong = odds / (1.0 + odds)
    metres = _way_out(run, point)
    stake = round(metres / _WALK / sequence.step_time)
    other = Place(place.step + (-stride if before else stride), *beyond.tolist())
    here = propose("here", (other,), accuracy=_ACCURACY)
    now = propose("came" if before else "left", (place,))
    word, was = ("begins", "there before") if before else ("ends", "there after")
    yield ReviewItem(
        "begins" if before else "ends", f"Track {track} {word} here?",
        f"{word} {metres:.1f} m from where people {'come' if before else 'leave'}, "
        f"in sight of {'a camera' if cameras == 1 else f'{cameras} cameras'}",
        place.step, place.step, (track,), (place,), wrong, stake,
        (Alternative("as it is", 1.0 - wrong, now), Alternative(was, wrong, here)),
    )  # fmt: skip


def _way_out(run: Run, point: Float[ndarray, " 3"]) -> float:
    """Return the distance on the ground to the room's nearest side or entrance, metres."""
    room = run.sequence.room
    sides = np.minimum(point - room.minimum, room.maximum - point)[:2].min()
    doors = [float(np.hypot(*(point - one.position)[:2])) for one in room.entrances]
    return max(float(min([sides, *doors])), 0.0)
