"""Moves at meetings: where two people are so close, or their boxes so ambiguous, that their tracks
may have been exchanged."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.review.queue.item import TrackRows
from tracker.review.queue.moves import Move, Tracklet
from tracker.runs.run import Run

_CLOSE = 2.0
"""Distance within which two people are close, in target widths."""

_EXCHANGED = 0.12
"""Prior probability that the tracks of two people at the same place are exchanged; it falls with
their distance d as exp(−d / w), with w the width of a target. In ten random crowds 5.0 % of 625
pairs of tracks that met within half a width were exchanged, 0.7 % of 824 within a width and none of
1,204 within two. With a decay twice as fast, fifteen truthful answers win as much in two of these
crowds and 0.01 more of IDF1 in a third."""

_ALONE = 1.5
"""Log odds of an exchange against its half, after which one track follows the other's person and
the other track ends."""

_TURN = 0.6
"""Standard deviation of the change of a person's velocity at a meeting, along each axis, metres per
second. Of people within two widths of each other it is 0.34 in ``cmc2``, 0.31 to 0.42 in random
crowds and 0.54 in ``wildtrack-points-300``; the places of tracks err besides."""

_STRIDE = 0.5
"""Time before and after a meeting over which velocities are measured, seconds."""

_MOST = 3.0
"""Largest log odds that the velocities contribute, since their model is approximate."""

_EXCHANGED_IF_AMBIGUOUS = 0.1
"""Least of this prior probability where their boxes are ambiguous."""

_AMBIGUOUS = 0.3
"""Ambiguous share of two people's boxes (see :func:`ambiguous_shares`) from which
their tracks may have been exchanged though they are not close."""


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
    ambiguous = ambiguous_shares(run)
    pause = max(round(1.0 / step_time), 2)
    for (one, other), met in _near(run, _CLOSE * width, ambiguous).items():
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
            ambiguous_share = max(
                ambiguous.get((one, other, int(steps[k])), 0.0) for k in part.tolist()
            )
            wrong = max(
                _EXCHANGED * float(np.exp(-apart / width)),
                _EXCHANGED_IF_AMBIGUOUS * (ambiguous_share > _AMBIGUOUS),
            )
            log_odds = float(np.log(wrong) - np.log1p(-wrong))
            log_odds += _velocity_log_odds(track_rows, one, other, nearest, step_time)
            title = f"Tracks {one} and {other} pass within {apart:.2f} m"
            why = f"nearest at step {nearest}"
            if ambiguous_share > _AMBIGUOUS:
                why += f", and {100 * ambiguous_share:.0f} % of their boxes fit either"
            for i, j in ((mine, its), (its, mine)):
                yield Move((i, j), (i, j), "crossing", log_odds, why, title)
                yield Move((i,), (i, j), "crossing", log_odds - _ALONE, why, title)


def _near(
    run: Run, reach: float, ambiguous: dict[tuple[int, int, int], float]
) -> dict[tuple[int, int], list[tuple[int, float]]]:
    """Return the steps at which two tracks are near, or their boxes ambiguous, for each pair of
    ids, each step with their distance in metres on the ground.

    Args:
        run: The run.
        reach: Distance within which two tracks are near, metres.
        ambiguous: The ambiguous shares, as returned by :func:`ambiguous_shares`.
    """
    tracks = run.tracks
    found: dict[tuple[int, int], list[tuple[int, float]]] = {}
    for step in np.unique(tracks.frames).tolist():
        own = tracks.at(step)
        ids, ground = tracks.ids[own].tolist(), tracks.positions[own, :2]
        apart = np.hypot(*(ground[:, None] - ground[None]).transpose(2, 0, 1))
        for a, b in np.argwhere(np.triu(apart < 2.0 * reach, 1)).tolist():
            pair = (ids[a], ids[b])
            if apart[a, b] < reach or ambiguous.get((*pair, step), 0.0) > _AMBIGUOUS:
                found.setdefault(pair, []).append((step, float(apart[a, b])))
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
        The log odds, clipped to ±3; 0 if a track has no place at one of the three steps.
    """
    stride = max(round(_STRIDE / step_time), 1)
    relative: Float[ndarray, "3 2"] = np.zeros((3, 2))
    for k, at in enumerate((step - stride, step, step + stride)):
        places = [track_rows.place(track, at) for track in (one, other)]
        if any(place.step != at for place in places):
            return 0.0
        relative[k] = np.subtract(places[0][1:3], places[1][1:3])
    before, after = np.diff(relative, axis=0) / (stride * step_time)
    return float(np.clip(-(before @ after) / _TURN**2, -_MOST, _MOST))


def ambiguous_shares(run: Run) -> dict[tuple[int, int, int], float]:
    """Return the ambiguous share of the boxes of two tracks.

    With p_c(z | i) the probability of the fusion that box z of camera c is of track i, the share of
    tracks i and j is Σ_c Σ_z min(p_c(z | i), p_c(z | j)), divided by the number of cameras that
    have boxes of i or j.

    Returns:
        The share, 0 … 1, by the ids of the two tracks, the smaller first, and the step; pairs
        without a common box are left out.
    """
    steps, labels, cameras, boxes, shares = _associated(run)
    if not len(steps):
        return {}
    who = _tracks_of(run, steps, labels)
    known = who >= 0
    steps, cameras, boxes, shares, who = (
        column[known] for column in (steps, cameras, boxes, shares, who)
    )
    order = np.lexsort((who, boxes, cameras, steps))
    steps, cameras, boxes, shares, who = (
        column[order] for column in (steps, cameras, boxes, shares, who)
    )
    seen_by: dict[tuple[int, int], set[int]] = {}
    for step, track, camera in zip(steps.tolist(), who.tolist(), cameras.tolist(), strict=True):
        seen_by.setdefault((step, track), set()).add(camera)
    total: dict[tuple[int, int, int], float] = {}
    for lag in range(1, len(steps)):
        same = np.flatnonzero(
            (steps[lag:] == steps[:-lag])
            & (cameras[lag:] == cameras[:-lag])
            & (boxes[lag:] == boxes[:-lag])
        )
        if not len(same):
            break
        for k in same.tolist():
            a, b, step = int(who[k]), int(who[k + lag]), int(steps[k])
            if a != b:
                share = float(min(shares[k], shares[k + lag]))
                total[a, b, step] = total.get((a, b, step), 0.0) + share
    return {
        (a, b, step): share / len(seen_by[step, a] | seen_by[step, b])
        for (a, b, step), share in total.items()
    }


def _associated(run: Run) -> tuple[ndarray, ndarray, ndarray, ndarray, ndarray]:
    """Return step, label, index of the camera, index of the box and probability of each
    association."""
    there = len(run.fused)  # a run that is being computed grows from one column to the next
    cameras, components, boxes, probabilities = (
        run.fused.column(f"associations.{name}", last=there)
        for name in ("cameras", "components", "boxes", "probabilities")
    )
    labels, steps = run.fused.column("posterior.labels", last=there), cameras.steps
    if not len(steps):
        nothing = np.zeros(0, dtype=np.int64)
        return nothing, nothing, nothing, nothing, np.zeros(0)
    named = labels.values[labels.starts[steps] + components.values]
    return steps, named, cameras.values, boxes.values, probabilities.values


def _tracks_of(run: Run, steps: Int[ndarray, " A"], labels: Int[ndarray, " A"]) -> ndarray:
    """Return the id of the track that has each label at each step; −1 for none."""
    tracks = run.tracks
    own = np.flatnonzero(tracks.labels >= 0)
    if not len(own):
        return np.full(len(steps), -1, dtype=np.int64)
    most = int(max(tracks.labels.max(), labels.max())) + 1
    keys = tracks.frames[own] * most + tracks.labels[own]
    order = np.argsort(keys, kind="stable")
    wanted = steps * most + labels
    at = np.minimum(np.searchsorted(keys, wanted, sorter=order), len(own) - 1)
    found = own[order[at]]
    hit = (keys[order[at]] == wanted) & (labels >= 0)
    return np.where(hit, tracks.ids[found], -1)
