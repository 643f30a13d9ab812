"""Where tracks begin and end though nobody comes or leaves there, and people whom none takes."""

from __future__ import annotations

from collections.abc import Collection, Iterator

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.corrections import Correction, Place
from tracker.corrections.kinds import leeway
from tracker.review.queue.item import Alternative, Lanes, ReviewItem, proposed
from tracker.review.queue.moves import ends_there
from tracker.review.queue.unclaimed import Unclaimed, unclaimed
from tracker.runs.run import Run

_MISSED = 0.3
"""Probability that a camera in whose picture somebody is has no box of him for a while."""

_WALK = 1.0
"""Metres a second: how fast who was missed came from where people come."""

_ASIDE = 0.5
"""Seconds before a track begins, or after it ends, at which somebody else may have been."""

_ACCURACY = 0.3
"""Metres: standard deviation of where he was."""

_APART = 1.0
"""Seconds between two places along the way of who is missing."""

_MOST_PLACES = 12

_NEAR, _WHILE = 1.0, 1.0
"""Metres and seconds between a track and boxes that nobody takes, which may be its person's."""


def of_edges(run: Run, lanes: Lanes, asked: Collection[Place]) -> Iterator[ReviewItem]:
    """Everybody who may be missing; then tracks that begin or end in the middle of the room.

    With q the probability that nobody comes, or leaves, at a place before anything is looked at,
    and n cameras that have it in their pictures and show nobody there before, that he was there
    has the odds q m^n / (1 − q), of m the probability of being missed by one.

    Args:
        run: Whose boxes.
        lanes: Its tracks.
        asked: First and last places of tracks that are asked for already, since others end or
            begin near there.
    """
    free = unclaimed(run)
    yield from (_missing(run, lanes, one) for one in free)
    near = leeway(run.sequence.step_time)
    for track in lanes.ids.tolist():
        rows = lanes.rows[track]
        first, last = lanes.of_row(int(rows[0])), lanes.of_row(int(rows[-1]))
        if first.step > near and first not in asked and not _shown(first, free, run, before=True):
            yield from _edge(run, lanes, track, before=True)
        if (
            run.complete
            and last.step < run.sequence.frames - 1 - near
            and last not in asked
            and not _shown(last, free, run, before=False)
        ):
            yield from _edge(run, lanes, track, before=False)


def _shown(place: Place, free: list[Unclaimed], run: Run, *, before: bool) -> bool:
    """Whether boxes that nobody takes say already what was there before, or after."""
    for one in free:
        end = one.places[-1 if before else 0]
        seconds = (place.step - end.step) * run.sequence.step_time * (1 if before else -1)
        apart = float(np.hypot(place.x - end.x, place.y - end.y))
        if -_WHILE <= seconds <= _WHILE and apart <= _NEAR + _WALK * abs(seconds):
            return True
    return False


def _missing(run: Run, lanes: Lanes, one: Unclaimed) -> ReviewItem:
    """Somebody whom boxes show."""
    seconds = len(one.places) * run.sequence.step_time
    wrong = float(0.8 * one.share * -np.expm1(-seconds * (len(one.cameras) - 1)))
    pause = max(round(_APART / run.sequence.step_time), 1)
    first, last = one.places[0], one.places[-1]
    spread = np.linspace(0, len(one.places) - 1, min(max((last.step - first.step) // pause, 2),
                                                     _MOST_PLACES, len(one.places)))  # fmt: skip
    along = [one.places[k] for k in np.unique(spread.round().astype(int)).tolist()]
    names = [run.sequence.cameras[number].name for number in one.cameras]
    told = f"{', '.join(names[:-1])} and {names[-1]}"
    here: tuple[Correction, ...] = tuple(
        said for place in along for said in proposed("here", (place,), accuracy=_ACCURACY)
    )
    return ReviewItem(
        "missing", "Somebody is missing?",
        f"boxes of {told} meet for {seconds:.1f} s where nobody is tracked",
        first.step, last.step, (), tuple(along), wrong, last.step - first.step + 1,
        (
            Alternative("nobody", 1.0 - wrong, proposed("nobody", along)),
            Alternative("somebody", wrong, here),
        ),
    )  # fmt: skip


def _edge(run: Run, lanes: Lanes, track: int, *, before: bool) -> Iterator[ReviewItem]:
    """A track that begins or ends where nobody should."""
    sequence = run.sequence
    rows = lanes.rows[track]
    stride = max(round(_ASIDE / sequence.step_time), 1)
    if len(rows) <= stride:
        return  # so short that it is asked for as nobody
    at, inner = (rows[0], rows[stride]) if before else (rows[-1], rows[-1 - stride])
    place, point = lanes.of_row(int(at)), lanes.tracks.positions[at]
    beyond = 2.0 * point - lanes.tracks.positions[inner]
    beyond[2] = point[2]
    if not sequence.room.contains(beyond[None])[0]:
        return
    cameras = sum(bool(camera.sees(beyond[None])[0]) for camera in sequence.cameras)
    if not cameras:
        return  # out of sight
    comes = ends_there(place, run)
    odds = (1.0 - comes) / comes * _MISSED**cameras
    wrong = odds / (1.0 + odds)
    metres = _way_out(run, point)
    stake = round(metres / _WALK / sequence.step_time)
    other = Place(place.step + (-stride if before else stride), *beyond.tolist())
    here = proposed("here", (other,), accuracy=_ACCURACY)
    now = proposed("came" if before else "left", (place,))
    word, was = ("begins", "there before") if before else ("ends", "there after")
    yield ReviewItem(
        "begins" if before else "ends", f"{track} {word} here?",
        f"{track} {word} {metres:.1f} m from where people {'come' if before else 'leave'}, "
        f"in sight of {'a camera' if cameras == 1 else f'{cameras} cameras'}",
        place.step, place.step, (track,), (place,), wrong, stake,
        (Alternative("as it is", 1.0 - wrong, now), Alternative(was, wrong, here)),
    )  # fmt: skip


def _way_out(run: Run, point: Float[ndarray, " 3"]) -> float:
    """Metres on the ground to the room's nearest side or entrance."""
    room = run.sequence.room
    sides = np.minimum(point - room.minimum, room.maximum - point)[:2].min()
    doors = [float(np.hypot(*(point - one.position)[:2])) for one in room.entrances]
    return max(float(min([sides, *doors])), 0.0)
