"""Splitting of the filter's tracks: at ambiguous boxes, at jumps, and in long gaps."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.parameters.groups.smoothing import SmoothingParams
from tracker.smoothing.lifetimes import estimate_lifetimes, independent_share
from tracker.smoothing.paths import Paths, split_paths
from tracker.smoothing.smoother import BoxAssociations, Fitted, Smoother
from tracker.smoothing.tracklets.constraints import ConstraintResolver
from tracker.smoothing.tracklets.costs import FASTEST, Rates
from tracker.smoothing.tracklets.motion import SLACK, exchange_breaks

GAP = 1.0
"""Time without a detection from which a track is split, seconds. From 0.3 to 4 s, no figure of the
random rooms, random crowds and recordings of ``tests/papers/rooms/fusion_ablations.md`` changes by
as much as 0.001: the parts are linked again."""

_DETECTED = 0.3
"""Sum of association probabilities over all cameras above which a row counts as detected.
From 0.1 to 0.9 no figure of four random crowds and four recordings changes: nearly every row has a
box of its own or none."""

_AROUND_A_JUMP = 0.2
"""Seconds before and after a jump that are left out of both tracklets. Without it no figure changes
by more than it scatters; doubled, recall in recordings falls by 0.007 and IDF1 by 0.005."""

_SHORTEST = 0.4
"""Shortest tracklet, seconds; shorter ones are left out where their path has longer ones. Halved
and without it, mean IDF1 changes by at most 0.002; doubled, recall in recordings falls by 0.007."""


@dataclass(slots=True, eq=False)
class Tracked:
    """Tracks whose identities are to be resolved, with data about their N rows."""

    smoother: Smoother
    """The models and the boxes."""
    fitted: Fitted
    """The filter's tracks, or those of the previous round, fitted to their boxes."""
    shared: BoxAssociations
    """Association probabilities of the rows and boxes."""
    contested: Float[ndarray, " N"]
    """Share of each row's boxes that may belong to another track as well, 0 … 1."""
    had: Bool[ndarray, " N"]
    """Whether the filter, or the previous round, had a track at each row; other rows fill gaps."""
    names: Int[ndarray, " N"]
    """The filter's label of each row, -1 where it had no track."""

    def forget_predictions(self) -> None:
        """Free the memory of what only :func:`find_splits` and corrections read."""
        self.fitted = self.fitted.without_predictions()

    def forget_states(self) -> None:
        """Free the memory of the states, once they are split for the last time."""
        self.fitted = replace(
            self.fitted.without_predictions(), paths=self.fitted.paths.without_states()
        )


@dataclass(frozen=True, slots=True, eq=False)
class Splits:
    """The splits of paths of N rows without any correction."""

    reasons: Int[ndarray, " N"]
    """Reason why each row is left out of tracklets: 0 none, 1 ambiguous boxes, 2 jump, 3 absent or
    not detected."""
    clear: Bool[ndarray, " N"]
    """The rows that remain in tracklets."""
    breaks: Bool[ndarray, " N"]
    """The rows before which a path is split though both sides remain."""
    rates: Rates
    """How often people come and leave."""


def find_splits(tracked: Tracked, p: SmoothingParams) -> Splits:
    """Find where tracks are split without any correction.

    Rows are left out where a share of ``p.ambiguity_threshold`` of the boxes may belong to another
    track, around a jump (the squared Mahalanobis distance between the estimates from the past and
    from the future exceeds ``p.jump``), and where no camera detected the track for longer than
    1 s. Tracks are also split where a swap with another track has log odds of at least
    ``p.exchange``.

    Args:
        tracked: The tracks, with N rows.
        p: Thresholds of the splits.
    """
    smoother, fitted, shared = tracked.smoother, tracked.fitted, tracked.shared
    step_time, paths = smoother.model.step_time, fitted.paths
    rows = len(paths.states)
    there, odds = estimate_lifetimes(smoother, paths, shared, p)
    reasons = np.zeros(rows, dtype=np.int64)
    detected = np.bincount(shared.links.rows, shared.links.shares, rows) > _DETECTED
    detected[smoother.rows_with_places(paths)[0]] = True
    too_long = round(GAP / step_time)
    away = _long_gaps(paths, detected, too_long) | (there < 0.5)
    reasons[away | _gaps_without_boxes(paths, tracked.had, away, too_long)] = 3
    around = round(_AROUND_A_JUMP / step_time)
    # errors of boxes are correlated: the distance is reduced to that of independent evidence
    jumps = np.flatnonzero(fitted.jumps * independent_share(step_time, p.memory) > p.jump)
    owners = paths.owners
    for offset in range(-around, around):
        near = np.clip(jumps + offset, 0, rows - 1)
        near = near[owners[near] == owners[jumps]]
        reasons[near] = 2
    reasons[tracked.contested >= p.ambiguity_threshold] = 1
    breaks = np.zeros(rows, dtype=bool)
    breaks[jumps] = True
    breaks |= exchange_breaks(
        fitted, reach=SLACK + FASTEST * step_time, least=p.exchange, apart=too_long
    )
    clear = _between(paths, detected & (reasons == 0)) & (reasons == 0)
    begins, between = _label_changes(paths, tracked.names)
    return Splits(reasons, clear & ~between, breaks | begins, Rates.of(smoother, paths, odds > 0.0))


def split_tracks(
    tracked: Tracked, plain: Splits, resolver: ConstraintResolver
) -> tuple[Paths, Int[ndarray, " M"]]:
    """Split tracks into tracklets with the filter's labels.

    Args:
        tracked: The tracks.
        plain: The splits without any correction.
        resolver: The splits of the corrections.

    Returns:
        The tracklets, with M rows, and the index of each of these rows in the tracks.
    """
    paths, owners = tracked.fitted.paths, tracked.fitted.paths.owners
    clear, breaks = plain.clear.copy(), plain.breaks | resolver.breaks()
    tracklets, source_rows = split_paths(paths, clear, breaks)
    # a short tracklet tells little about identity; it remains only if its path has no longer one
    lengths = np.diff(tracklets.starts)
    of = owners[source_rows[tracklets.starts[:-1]]]
    longest = np.zeros(len(paths.labels), dtype=np.int64)
    np.maximum.at(longest, of, lengths)
    shortest = round(_SHORTEST / tracked.smoother.model.step_time)
    short = (lengths < shortest) & (longest[of] >= shortest)
    short[list(resolver.referenced_tracklets(tracklets, source_rows))] = False
    clear[source_rows[np.repeat(short, lengths)]] = False
    tracklets, source_rows = split_paths(paths, clear, breaks)
    return replace(
        tracklets, labels=_filter_labels(tracklets, tracked.names[source_rows])
    ), source_rows


def _label_changes(
    paths: Paths, names: Int[ndarray, " N"]
) -> tuple[Bool[ndarray, " N"], Bool[ndarray, " N"]]:
    """Find the rows at which the filter's label of a path changes.

    Returns:
        Whether each row is the first with another label than before, and whether each row is one
        without a label between two different labels.
    """
    begins = np.zeros(len(names), dtype=bool)
    between = begins.copy()
    rows = np.flatnonzero(names >= 0)
    if len(rows):
        owners = paths.owners
        other = (np.diff(names[rows]) != 0) & (np.diff(owners[rows]) == 0)
        begins[rows[1:][other]] = True
        before = np.searchsorted(rows, np.arange(len(names)), side="right") - 1
        between = (names < 0) & np.append(other, False)[before] & (before >= 0)
    return begins, between


def _filter_labels(tracklets: Paths, names: Int[ndarray, " M"]) -> Int[ndarray, " n"]:
    """Return the filter's label of each tracklet; one without such a label retains its own."""
    labels = tracklets.labels.copy()
    known = np.flatnonzero(names >= 0)
    owners, first = np.unique(tracklets.owners[known], return_index=True)
    labels[owners] = names[known[first]]
    return labels


def _runs(paths: Paths, flags: Bool[ndarray, " N"]) -> Int[ndarray, " N"]:
    """Return the index of the run of consecutive equal flags, within one path, of each row."""
    change = np.ones(len(flags), dtype=bool)
    change[1:] = (flags[1:] != flags[:-1]) | (np.diff(paths.owners) != 0)
    return np.asarray(np.cumsum(change) - 1)


def _long_gaps(paths: Paths, detected: Bool[ndarray, " N"], longest: int) -> Bool[ndarray, " N"]:
    """Find the rows in runs of more than ``longest`` rows without a detection."""
    run = _runs(paths, detected)
    return np.asarray(~detected & (np.bincount(run)[run] > longest)) if len(detected) else detected


def _gaps_without_boxes(
    paths: Paths, had: Bool[ndarray, " N"], away: Bool[ndarray, " N"], longest: int
) -> Bool[ndarray, " N"]:
    """Find the rows of the filter's long gaps of which a part is ``away``, without boxes for long.

    Boxes do not connect the two sides of such a gap, so the person may have continued as another
    track of the filter.
    """
    gaps = _long_gaps(paths, had, longest)
    run = _runs(paths, had)
    return np.asarray(gaps & (np.bincount(run, away & gaps)[run] > 0.0)) if len(had) else gaps


def _between(paths: Paths, seen: Bool[ndarray, " N"]) -> Bool[ndarray, " N"]:
    """Find the rows from the first to the last detected one of each path."""
    rows, owners = np.arange(len(seen)), paths.owners
    first = np.full(len(paths.labels), len(seen))
    last = np.full(len(paths.labels), -1)
    np.minimum.at(first, owners[seen], rows[seen])
    np.maximum.at(last, owners[seen], rows[seen])
    return np.asarray((rows >= first[owners]) & (rows <= last[owners]))
