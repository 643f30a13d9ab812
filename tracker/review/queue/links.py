"""Changes of the links of a run, by the costs of the tracklet association."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from tracker.corrections import Place
from tracker.review.queue.item import TrackRows
from tracker.review.queue.moves import Move, Tracklet
from tracker.runs.run import Run
from tracker.smoothing import names_of
from tracker.smoothing.protocol import LinkedTracklets

_TEMPERED = 3.0
"""Divisor of the log odds of the association, whose model takes dependent boxes as independent and
is therefore too certain. In twelve random crowds the log loss of an item's probability is 0.83
without it, 0.79 with it and at best, from 6 on, 0.77. Truthful answers win as much by 6: in the
mean over ten to fifteen of them IDF1 differs by 0.002 to 0.010 in favour of 6 in four random
crowds, by 0.001 against it in ``wildtrack-points-300``."""

LEAST_LOG_ODDS = -7.0
"""Least log odds of a move that is considered: at worse ones, a thousand to one against, no item is
likelier than a rounded 0.1 %."""


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
        return [whole_track(track_rows, int(track)) for track in track_rows.ids], None
    names = names_of(run.smoothed, run.tracks)
    if not names:
        return [whole_track(track_rows, int(track)) for track in track_rows.ids], None
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


def whole_track(track_rows: TrackRows, track: int) -> Tracklet:
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
        if move.log_odds > LEAST_LOG_ODDS:
            yield move
    for i, j in following.items():
        one, other = tracklets[i], tracklets[j]
        if one is None or other is None:
            continue
        log_odds = (float(deaths[i] + births[j]) - gain_in_run(i)) / _TEMPERED
        if log_odds > LEAST_LOG_ODDS:
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
