"""Moves by the costs of tracklet association, and by a model of people who are lost for a while."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from tracker.corrections import Place
from tracker.review.queue.item import TrackRows
from tracker.review.queue.linking import Move, Tracklet
from tracker.runs.run import Run
from tracker.smoothing import names_of
from tracker.smoothing.result import LinkedTracklets

_TEMPERED = 3.0
"""Divisor of the log odds of the association, whose model takes dependent boxes as independent and
is therefore too certain. In twelve random crowds the log loss of an item's probability is 0.83
without it, 0.79 with it and at best, from 6 on, 0.77. Truthful answers win as much by 6: in the
mean over ten to fifteen of them IDF1 differs by 0.002 to 0.010 in favour of 6 in four random
crowds, by 0.001 against it in ``wildtrack-points-300``."""

_LONGEST = 20.0
"""Longest time after which a lost person may come back, and time constant of the probability of it,
seconds."""

_SPEED = 0.6
"""Standard deviation of the velocity of a lost person, metres per second."""

_STRAIGHT = 4.0
"""Time for which a lost person keeps direction and velocity, seconds; later the displacement grows
as that of a random walk."""

_NEAR = 0.4
"""Standard deviation of the place of a person that has just been lost, metres."""

_EDGE = 0.5
"""Distance from the room's sides within which people leave and come, metres."""

_LEAVES_AT_AN_EDGE, _LEAVES_INSIDE = 0.9, 0.2
"""Prior probability that the person of a track has left the room where the track ends: at a side or
an entrance of the room, and elsewhere."""

_LEAST_LOG_ODDS = -7.0
"""Least log odds of a move that is considered; half of it for joins of lost people."""


def tracklets_of(
    run: Run, track_rows: TrackRows
) -> tuple[list[Tracklet | None], LinkedTracklets | None]:
    """Return the tracklets that the smoothing linked to tracks, and the gains of its links.

    If no smoothing linked the tracks that the run has now (they may be the filter's, or those of
    another run that are displayed until this one is computed), each track is one tracklet, and
    there are no gains. A tracklet whose track is not reported is None.
    """
    joined = None if run.smoothed is None else run.smoothed.joined
    if joined is None or run.smoothed is None:
        return [_whole(track_rows, int(track)) for track in track_rows.ids], None
    names = names_of(run.smoothed, run.tracks)
    if not names:
        return [_whole(track_rows, int(track)) for track in track_rows.ids], None
    found: list[Tracklet | None] = []
    for k, label in enumerate(joined.labels.tolist()):
        track = names.get(label)
        if track is None:
            found.append(None)
            continue
        first, last = int(joined.firsts[k]), int(joined.lasts[k])
        begin = Place(first, *joined.begins[k].tolist())
        end = Place(last, *joined.ends[k].tolist())
        found.append(Tracklet(track, begin, end))
    return found, joined


def _whole(track_rows: TrackRows, track: int) -> Tracklet:
    """Return a track as one tracklet."""
    rows = track_rows.rows[track]
    begin, end = track_rows.of_row(int(rows[0])), track_rows.of_row(int(rows[-1]))
    return Tracklet(track, begin, end)


def moves_of_links(tracklets: list[Tracklet | None], joined: LinkedTracklets) -> Iterator[Move]:
    """Yield all changes of one or two links, by the gains of the tracklet association.

    The run has the assignment with the largest sum of gains. The assignments next to it exchange
    two links, cut a link, link a free end with a free begin, or replace a link by one to a free
    begin or end. The log odds of each are the difference of its sum of gains from the run's,
    divided by :data:`_TEMPERED`.

    Args:
        tracklets: The tracklets, as returned by :func:`tracklets_of`.
        joined: The gains of their links.
    """
    gains = {
        (i, j): g
        for i, j, g in zip(
            joined.earlier.tolist(), joined.later.tolist(), joined.gains.tolist(), strict=True
        )
    }
    following, before = _links(tracklets, joined)
    births, deaths = joined.births, joined.deaths

    def gain_in_run(i: int) -> float:
        """Return the gain of a tracklet's link to a later one in the run, or of its end."""
        j = following.get(i, -1)
        return float(deaths[i]) if j < 0 else gains.get((i, j), float(deaths[i] + births[j]))

    for (i, j), gain in gains.items():
        one, other = tracklets[i], tracklets[j]
        if one is None or other is None or following.get(i) == j:
            continue
        now, pred = following.get(i, -1), before.get(j, -1)
        log_odds = gain - gain_in_run(i)
        log_odds -= float(births[j]) if pred < 0 else gain_in_run(pred)
        after = tracklets[now] if now >= 0 else None
        earlier = tracklets[pred] if pred >= 0 else None
        if after is not None and earlier is not None:
            if (pred, now) not in gains:
                log_odds += float(deaths[pred] + births[now])
                # the other two tracklets cannot be linked: one ends, the other begins
            else:
                log_odds += gains[pred, now]
            move = Move((one, earlier), (after, other), "exchange", log_odds / _TEMPERED)
        elif after is not None:
            move = Move(
                (one,), (after, other), "exchange", (log_odds + float(births[now])) / _TEMPERED
            )
        elif earlier is not None:
            move = Move(
                (earlier, one), (other,), "exchange", (log_odds + float(deaths[pred])) / _TEMPERED
            )
        else:
            move = Move((one,), (other,), "join", log_odds / _TEMPERED)
        if move.log_odds > _LEAST_LOG_ODDS:
            yield move
    for i, j in following.items():
        one, other = tracklets[i], tracklets[j]
        if one is None or other is None:
            continue
        log_odds = (float(deaths[i] + births[j]) - gain_in_run(i)) / _TEMPERED
        if log_odds > _LEAST_LOG_ODDS:
            yield Move((one,), (other,), "cut", log_odds)


def _links(
    tracklets: list[Tracklet | None], joined: LinkedTracklets
) -> tuple[dict[int, int], dict[int, int]]:
    """Return the index of the next tracklet of each tracklet in its track, and of the previous
    one."""
    following: dict[int, int] = {}
    latest: dict[int, int] = {}
    for k in np.argsort(joined.firsts, kind="stable").tolist():
        if tracklets[k] is None:
            continue
        label = int(joined.labels[k])
        if label in latest:
            following[latest[label]] = k
        latest[label] = k
    return following, {j: i for i, j in following.items()}


def joins_of_lost_people(
    run: Run, track_rows: TrackRows, known: set[tuple[Place, Place]]
) -> Iterator[Move]:
    """Yield joins of tracks that end, each with a track that begins near by at a later step.

    Let p_i be the probability that the person of track i has left where it ends, A the area of the
    room on the ground, and f_ij = N(x_j; x_i, σ_ij² I) exp(−t_ij / T) the density of the place of a
    lost person after the gap of t_ij ≤ T seconds, with σ_ij² = s² + v² t_ij min(t_ij, t_0), where
    s, v, t_0 and T are :data:`_NEAR`, :data:`_SPEED`, :data:`_STRAIGHT` and :data:`_LONGEST`. The
    odds that j is the continuation of i are

        (1 − p_i) f_ij / [p_i / A + Σ_{k≠j} (1 − p_i) f_ik]

    The odds that j continues i and no other track are the same with the probability that the person
    of track j has come in where it begins instead of p_i, and with the sum over the other tracks
    that end. The smaller odds count.

    Args:
        run: The run.
        track_rows: The run's tracks.
        known: Pairs of end and begin for which there is a move already.
    """
    sequence = run.sequence
    area = float(np.prod((sequence.room.maximum - sequence.room.minimum)[:2]))
    whole = [_whole(track_rows, int(track)) for track in track_rows.ids]
    ends = [one for one in whole if one.end.step < sequence.frames - 1]
    begins = [one for one in whole if one.begin.step > 0]
    if not ends or not begins:
        return
    e = np.array([one.end for one in ends], dtype=float)
    b = np.array([one.begin for one in begins], dtype=float)
    seconds = (b[None, :, 0] - e[:, None, 0]) * sequence.step_time
    apart = np.hypot(b[None, :, 1] - e[:, None, 1], b[None, :, 2] - e[:, None, 2])
    spread = _NEAR**2 + (_SPEED**2) * np.maximum(seconds, 0.0) * np.minimum(
        np.maximum(seconds, 0.0), _STRAIGHT
    )
    possible = (seconds > 0.0) & (seconds <= _LONGEST)
    density = np.exp(-0.5 * apart**2 / spread) / (2.0 * np.pi * spread)
    density = np.where(possible, density, 0.0)
    density *= np.exp(-np.maximum(seconds, 0.0) / _LONGEST)
    leaves = np.array([leaving_probability(one.end, run) for one in ends])[:, None]
    comes = np.array([leaving_probability(one.begin, run) for one in begins])[None, :]
    left = (1.0 - leaves) * density
    forward = left / (leaves / area + left.sum(axis=1, keepdims=True) - left + 1e-12)
    came = (1.0 - comes) * density
    backward = came / (comes / area + came.sum(axis=0, keepdims=True) - came + 1e-12)
    log_odds = np.log(np.maximum(np.minimum(forward, backward), 1e-12))
    for i, j in np.argwhere(log_odds > _LEAST_LOG_ODDS / 2.0).tolist():
        if (ends[i].end, begins[j].begin) not in known:
            yield Move((ends[i],), (begins[j],), "join", float(log_odds[i, j]))


def leaving_probability(place: Place, run: Run) -> float:
    """Return the prior probability that people leave, or come, at a place."""
    point, low, high = place.point, run.sequence.room.minimum, run.sequence.room.maximum
    margin = float(np.minimum(point - low, high - point)[:2].min())
    entrances = run.sequence.room.entrances
    at_door = any(
        (np.abs(point - one.position)[:2] <= 2.0 * one.sigma[:2] + _EDGE).all() for one in entrances
    )
    return _LEAVES_AT_AN_EDGE if margin < _EDGE or at_door else _LEAVES_INSIDE
