"""Links over gaps for which no tracklets are compared: people who are lost for a while."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from tracker.corrections import Place
from tracker.review.queue.item import TrackRows
from tracker.review.queue.links import LEAST_LOG_ODDS, whole_track
from tracker.review.queue.moves import Move
from tracker.runs.run import Run

_LONGEST = 20.0
"""Longest time after which a lost person may come back, and time constant of the probability of it,
seconds. Halved or doubled it changes 15 joins to 19 or 17, and none is found more or less."""

_SPEED = 0.6
"""Standard deviation of the velocity of a lost person along each axis, metres per second. In one
second people move by 0.4 to 0.8 m along an axis (root mean square) in five recordings and four
random crowds."""

_STRAIGHT = 4.0
"""Time for which a lost person keeps direction and velocity, seconds; later the displacement grows
as that of a random walk. In the same recordings it grows like the time up to two to four seconds,
to 1.0 to 2.6 m, and after eight it has grown by no more than two thirds."""

_NEAR = 0.4
"""Standard deviation of the place of a person that has just been lost, metres: 99 % of the places
of tracks err by less than 0.6 m in three recordings and ten random crowds."""

_EDGE = 0.5
"""Distance from the room's sides within which people leave and come, metres. Halved or doubled, the
log loss of the probability of a join is 0.60 or 0.77 instead of 0.45."""

_LEAVES_AT_AN_EDGE, _LEAVES_INSIDE = 0.9, 0.2
"""Prior probability that the person of a track has left the room where the track ends: at a side or
an entrance of the room, and elsewhere. It is a prior that no recording tells: inside the room
88 % of the ends are such in a piece of ``wildtrack-points-300``, whose truth is of a part of the
square, and none are in random crowds, which nobody leaves."""


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
    whole = [whole_track(track_rows, int(track)) for track in track_rows.ids]
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
    for i, j in np.argwhere(log_odds > LEAST_LOG_ODDS / 2.0).tolist():
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
