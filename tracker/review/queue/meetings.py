"""Moves at meetings: where two people are so close that their tracks may have been exchanged."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.review.queue.item import TrackRows
from tracker.review.queue.moves import Move, Tracklet
from tracker.runs.run import Run

_CLOSE = 2.0
"""Distance within which two people are close, in target widths. Halved, 76 mistakes are found;
doubled 87, but the log loss of a crossing's probability is 1.49 instead of 1.27."""

_EXCHANGED = 0.12
"""Prior probability that the tracks of two people at the same place are exchanged; it falls with
their distance d as exp(−d / w), with w the width of a target. In ten random crowds 5.0 % of 625
pairs of tracks that met within half a width were exchanged, 0.7 % of 824 within a width and none of
1,204 within two. With a decay twice as fast, fifteen truthful answers win as much in two of these
crowds and 0.01 more of IDF1 in a third."""

_ALONE = 1.5
"""Log odds of an exchange against its half, after which one track follows the other's person and
the other track ends. Halved or doubled, 79 or 82 mistakes are found, and the log loss of a
crossing's probability is 1.21 or 1.32 instead of 1.27."""

_TURN = 0.6
"""Standard deviation of the change of a person's velocity at a meeting, along each axis, metres per
second. Of people within two widths of each other it is 0.34 in ``cmc2``, 0.31 to 0.42 in random
crowds and 0.54 in ``wildtrack-points-300``; the places of tracks err besides."""

_STRIDE = 0.5
"""Time before and after a meeting over which velocities are measured, seconds. Halved, 76 mistakes
are found and the log loss is 1.36; doubled 84, at 1.18."""


def meetings(run: Run, track_rows: TrackRows) -> Iterator[Move]:
    """Yield the exchange, and its halves, for each time that two people meet.

    The odds are a prior that depends on the distance, times the likelihood ratio of the velocities.
    With u and v the velocity of the one person relative to the other before and after the meeting,
    and changes of each person's velocity distributed as N(0, σ² I),

        log odds = −u · v / σ²

    so two tracks that go straight on have probably kept their persons, and two that turn back at a
    meeting were probably exchanged.
    """
    step_time = run.sequence.step_time
    width = 2.0 * float(run.sequence.target_half_extents[:2].mean())
    pause = max(round(1.0 / step_time), 2)
    for (one, other), met in _near(run, _CLOSE * width).items():
        steps = np.array([step for step, _ in met])
        for part in np.split(np.arange(len(met)), np.flatnonzero(np.diff(steps) > pause) + 1):
            nearest, apart = min((met[k] for k in part.tolist()), key=lambda at: at[1])
            first, last = int(steps[part[0]]) - 1, int(steps[part[-1]]) + 1
            mine, its = (
                Tracklet(
                    track, track_rows.place(track, last, after=True), track_rows.place(track, first)
                )
                for track in (one, other)
            )
            wrong = _EXCHANGED * float(np.exp(-apart / width))
            log_odds = float(np.log(wrong) - np.log1p(-wrong))
            log_odds += _velocity_log_odds(track_rows, one, other, nearest, step_time)
            title = f"Tracks {one} and {other} pass within {apart:.2f} m"
            why = f"nearest at step {nearest}"
            for i, j in ((mine, its), (its, mine)):
                yield Move((i, j), (i, j), "crossing", log_odds, why, title)
                yield Move((i,), (i, j), "crossing", log_odds - _ALONE, why, title)


def _near(run: Run, reach: float) -> dict[tuple[int, int], list[tuple[int, float]]]:
    """Return the steps at which two tracks are near, for each pair of ids, each step with their
    distance in metres on the ground.

    Args:
        run: The run.
        reach: Distance within which two tracks are near, metres.
    """
    tracks = run.tracks
    found: dict[tuple[int, int], list[tuple[int, float]]] = {}
    for step in np.unique(tracks.frames).tolist():
        own = tracks.at(step)
        ids, ground = tracks.ids[own].tolist(), tracks.positions[own, :2]
        apart = np.hypot(*(ground[:, None] - ground[None]).transpose(2, 0, 1))
        for a, b in np.argwhere(np.triu(apart < reach, 1)).tolist():
            found.setdefault((ids[a], ids[b]), []).append((step, float(apart[a, b])))
    return found


def _velocity_log_odds(
    track_rows: TrackRows, one: int, other: int, step: int, step_time: float
) -> float:
    """Return the log odds of an exchange by the velocities before and after it, as in
    :func:`meetings`.

    Args:
        track_rows: The run's tracks.
        one: The id of the first track.
        other: The id of the second track.
        step: The step at which they meet.
        step_time: Duration of a step, seconds.

    Returns:
        The log odds; 0 if a track has no place at one of the three steps.
    """
    stride = max(round(_STRIDE / step_time), 1)
    relative: Float[ndarray, "3 2"] = np.zeros((3, 2))
    for k, at in enumerate((step - stride, step, step + stride)):
        places = [track_rows.place(track, at) for track in (one, other)]
        if any(place.step != at for place in places):
            return 0.0
        relative[k] = np.subtract(places[0][1:3], places[1][1:3])
    before, after = np.diff(relative, axis=0) / (stride * step_time)
    return float(-(before @ after) / _TURN**2)
