"""Other links between the pieces of a run: by the odds of its joining, and by what is likely of
people who are lost from sight."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from tracker.corrections import Place
from tracker.review.queue.item import Lanes
from tracker.review.queue.linking import Move, Piece
from tracker.runs.run import Run
from tracker.smoothing import names_of
from tracker.smoothing.result import Joined

_TEMPERED = 3.0
"""What the odds of joins are divided by: their models take for independent what is not."""

_LONGEST = 20.0
"""Seconds that somebody may be out of sight and come back, where no method says so itself."""

_SPEED = 0.6
"""Metres a second: standard deviation of where somebody goes who is out of sight."""

_NEAR = 0.4
"""Metres: standard deviation of where somebody is at once."""

_EDGE = 0.5
"""Metres from the room's sides within which people leave and come."""

_LEAVES_AT_AN_EDGE, _LEAVES_INSIDE = 0.9, 0.2
"""How probable it is, before anything is looked at, that a track that ends there has left."""

_WORTH = -7.0
"""log odds from which a move is worth a thought."""


def pieces_of(run: Run, lanes: Lanes) -> tuple[list[Piece | None], Joined | None]:
    """The pieces that the run's tracks were joined of; where it joined none, its tracks. So it is
    while they are still the filter's, or those of another run that are shown meanwhile.

    A piece of somebody who is not reported is None.
    """
    joined = None if run.smoothed is None else run.smoothed.joined
    if joined is None or run.smoothed is None:
        return [_whole(lanes, int(track)) for track in lanes.ids], None
    names = names_of(run.smoothed, run.tracks)
    if not names:
        return [_whole(lanes, int(track)) for track in lanes.ids], None
    found: list[Piece | None] = []
    for k, label in enumerate(joined.labels.tolist()):
        track = names.get(label)
        if track is None:
            found.append(None)
            continue
        first, last = int(joined.firsts[k]), int(joined.lasts[k])
        begin = Place(first, *joined.begins[k].tolist())
        end = Place(last, *joined.ends[k].tolist())
        found.append(Piece(track, begin, end))
    return found, joined


def _whole(lanes: Lanes, track: int) -> Piece:
    rows = lanes.rows[track]
    begin, end = lanes.of_row(int(rows[0])), lanes.of_row(int(rows[-1]))
    return Piece(track, begin, end)


def of_joining(pieces: list[Piece | None], joined: Joined) -> Iterator[Move]:
    """Every way to link two or four ends otherwise, by the odds of the joining.

    The run has the best of all ways; one step away from it are the exchange of two links, a link
    that is cut, one between a free end and a free begin, and one that goes to a free one instead.
    """
    gains = {
        (i, j): g
        for i, j, g in zip(
            joined.earlier.tolist(), joined.later.tolist(), joined.gains.tolist(), strict=True
        )
    }
    following, before = _links(pieces, joined)
    births, deaths = joined.births, joined.deaths

    def has(i: int) -> float:
        """The odds of how a piece goes on now."""
        j = following.get(i, -1)
        return float(deaths[i]) if j < 0 else gains.get((i, j), float(deaths[i] + births[j]))

    for (i, j), gain in gains.items():
        one, other = pieces[i], pieces[j]
        if one is None or other is None or following.get(i) == j:
            continue
        now, pred = following.get(i, -1), before.get(j, -1)
        odds = gain - has(i)
        odds -= float(births[j]) if pred < 0 else has(pred)
        after = pieces[now] if now >= 0 else None
        earlier = pieces[pred] if pred >= 0 else None
        if after is not None and earlier is not None:
            if (pred, now) not in gains:
                odds += float(deaths[pred] + births[now])
                # the two that are left over end and begin
            else:
                odds += gains[pred, now]
            move = Move((one, earlier), (after, other), "exchange", odds / _TEMPERED)
        elif after is not None:
            move = Move((one,), (after, other), "exchange", (odds + float(births[now])) / _TEMPERED)
        elif earlier is not None:
            move = Move(
                (earlier, one), (other,), "exchange", (odds + float(deaths[pred])) / _TEMPERED
            )
        else:
            move = Move((one,), (other,), "join", odds / _TEMPERED)
        if move.odds > _WORTH:
            yield move
    for i, j in following.items():
        one, other = pieces[i], pieces[j]
        if one is None or other is None:
            continue
        odds = (float(deaths[i] + births[j]) - has(i)) / _TEMPERED
        if odds > _WORTH:
            yield Move((one,), (other,), "cut", odds)


def _links(pieces: list[Piece | None], joined: Joined) -> tuple[dict[int, int], dict[int, int]]:
    """Which piece follows which, and which comes before which."""
    following: dict[int, int] = {}
    latest: dict[int, int] = {}
    for k in np.argsort(joined.firsts, kind="stable").tolist():
        if pieces[k] is None:
            continue
        label = int(joined.labels[k])
        if label in latest:
            following[latest[label]] = k
        latest[label] = k
    return following, {j: i for i, j in following.items()}


def of_the_lost(run: Run, lanes: Lanes, known: set[tuple[Place, Place]]) -> Iterator[Move]:
    """Tracks that end and others that begin later, near enough to be one person's.

    With p_i that who is lost at the end of i has left, the room's area A, and where he would be
    after a while N(x; x_i, S), i goes on as j with the odds

        (1 − p_i) N(x_j; x_i, S) / [p_i / A + Σ_{k≠j} (1 − p_i) N(x_k; x_i, S)]

    and likewise seen from j; the smaller of both counts.

    Args:
        run: Whose room and steps.
        lanes: Its tracks.
        known: Pairs of places that have odds already.
    """
    sequence = run.sequence
    area = float(np.prod((sequence.room.maximum - sequence.room.minimum)[:2]))
    whole = [_whole(lanes, int(track)) for track in lanes.ids]
    ends = [one for one in whole if one.end.step < sequence.frames - 1]
    begins = [one for one in whole if one.begin.step > 0]
    if not ends or not begins:
        return
    e = np.array([one.end for one in ends], dtype=float)
    b = np.array([one.begin for one in begins], dtype=float)
    seconds = (b[None, :, 0] - e[:, None, 0]) * sequence.step_time
    apart = np.hypot(b[None, :, 1] - e[:, None, 1], b[None, :, 2] - e[:, None, 2])
    spread = _NEAR**2 + (_SPEED**2) * np.maximum(seconds, 0.0) * np.minimum(
        np.maximum(seconds, 0.0), 4.0
    )
    possible = (seconds > 0.0) & (seconds <= _LONGEST)
    density = np.exp(-0.5 * apart**2 / spread) / (2.0 * np.pi * spread)
    density = np.where(possible, density, 0.0)
    density *= np.exp(-np.maximum(seconds, 0.0) / _LONGEST)
    leaves = np.array([ends_there(one.end, run) for one in ends])[:, None]
    comes = np.array([ends_there(one.begin, run) for one in begins])[None, :]
    left = (1.0 - leaves) * density
    forward = left / (leaves / area + left.sum(axis=1, keepdims=True) - left + 1e-12)
    came = (1.0 - comes) * density
    backward = came / (comes / area + came.sum(axis=0, keepdims=True) - came + 1e-12)
    odds = np.log(np.maximum(np.minimum(forward, backward), 1e-12))
    for i, j in np.argwhere(odds > _WORTH / 2.0).tolist():
        if (ends[i].end, begins[j].begin) not in known:
            yield Move((ends[i],), (begins[j],), "join", float(odds[i, j]))


def ends_there(place: Place, run: Run) -> float:
    """How probable it is that people leave, or come, at a place."""
    point, low, high = place.point, run.sequence.room.minimum, run.sequence.room.maximum
    margin = float(np.minimum(point - low, high - point)[:2].min())
    entrances = run.sequence.room.entrances
    at_door = any(
        (np.abs(point - one.position)[:2] <= 2.0 * one.sigma[:2] + _EDGE).all() for one in entrances
    )
    return _LEAVES_AT_AN_EDGE if margin < _EDGE or at_door else _LEAVES_INSIDE
