"""Where the filter's tracks are cut: at a draw, a contradiction, where nobody saw them for long."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.parameters import SmoothingParams
from tracker.smoothing.identity import pieces
from tracker.smoothing.identity.constraints import Seeker
from tracker.smoothing.identity.exchanges import exchange_breaks
from tracker.smoothing.identity.odds import FASTEST
from tracker.smoothing.lifetimes import independence, lifetimes
from tracker.smoothing.paths import Paths
from tracker.smoothing.smoother import Fitted, Shared, Smoother

_FED = 0.3
"""Boxes, of all cameras together, from which a row counts as seen."""

_AROUND = 0.2
"""Seconds around a jump that belong to neither side."""

_SHORTEST = 0.4
"""Seconds of a piece that stands for itself; a shorter one, beside longer ones, is left out."""


@dataclass(frozen=True, slots=True, eq=False)
class Tracked:
    """Tracks whose people are to be settled, and what is known of their N rows."""

    smoother: Smoother
    """The models."""
    fitted: Fitted
    """The filter's tracks, or what was made of them before, fitted to their boxes."""
    shared: Shared
    """Whose box each is."""
    contested: Float[ndarray, " N"]
    """By which share each row's boxes were as well another's."""
    had: Bool[ndarray, " N"]
    """At which rows there was a track before."""
    names: Int[ndarray, " N"]
    """The filter's label of each row, -1 where it had nobody."""


@dataclass(frozen=True, slots=True, eq=False)
class Cuts:
    """Where N rows are cut by themselves, whatever a person says of them."""

    reasons: Int[ndarray, " N"]
    """Why each row is left out: 0 for not, 1 contested, 2 jump, 3 away or not seen."""
    clear: Bool[ndarray, " N"]
    """The rows that are kept."""
    breaks: Bool[ndarray, " N"]
    """Rows before which a path is cut even where both sides are clear."""


def cuts(tracked: Tracked, p: SmoothingParams) -> Cuts:
    """Where tracks are cut by themselves."""
    smoother, fitted, shared = tracked.smoother, tracked.fitted, tracked.shared
    step_time, paths = smoother.model.step_time, fitted.paths
    rows = len(paths.states)
    there, _ = lifetimes(smoother, paths, shared, p)
    reasons = np.zeros(rows, dtype=np.int64)
    fed = np.bincount(shared.links.rows, shared.links.shares, rows) > _FED
    fed[smoother.pinned(paths)[0]] = True
    too_long = round(p.gap / step_time)
    away = _long_gaps(paths, fed, too_long) | (there < 0.5)
    reasons[away | _not_bridged(paths, tracked.had, away, too_long)] = 3
    around = round(_AROUND / step_time)
    # where boxes err alike for a while, past and future contradict each other by less than it seems
    jumps = np.flatnonzero(fitted.jumps * independence(step_time, p.memory) > p.jump)
    owners = paths.owners
    for offset in range(-around, around):
        near = np.clip(jumps + offset, 0, rows - 1)
        near = near[owners[near] == owners[jumps]]
        reasons[near] = 2
    reasons[tracked.contested >= p.doubt] = 1
    breaks = np.zeros(rows, dtype=bool)
    breaks[jumps] = True
    breaks |= exchange_breaks(
        fitted, reach=1.0 + FASTEST * step_time, least=p.exchange, apart=too_long
    )
    clear = _between(paths, fed & (reasons == 0)) & (reasons == 0)
    begins, between = _of_two(paths, tracked.names)
    return Cuts(reasons, clear & ~between, breaks | begins)


def cut(tracked: Tracked, plain: Cuts, seeker: Seeker) -> tuple[Paths, Int[ndarray, " M"]]:
    """The pieces under the filter's labels, and the row that each of their rows was.

    Args:
        tracked: What is cut.
        plain: Where it is by itself.
        seeker: Where corrections cut it.
    """
    paths, owners = tracked.fitted.paths, tracked.fitted.paths.owners
    clear, breaks = plain.clear.copy(), plain.breaks | seeker.breaks()
    cut, kept = pieces.cut(paths, clear, breaks)
    # a short piece says little of who it is; where it is all there is it stays
    lengths = np.diff(cut.starts)
    of = owners[kept[cut.starts[:-1]]]
    longest = np.zeros(len(paths.labels), dtype=np.int64)
    np.maximum.at(longest, of, lengths)
    shortest = round(_SHORTEST / tracked.smoother.model.step_time)
    short = (lengths < shortest) & (longest[of] >= shortest)
    short[list(seeker.meant(cut, kept))] = False
    clear[kept[np.repeat(short, lengths)]] = False
    cut, kept = pieces.cut(paths, clear, breaks)
    return replace(cut, labels=_named(cut, tracked.names[kept])), kept


def _of_two(
    paths: Paths, names: Int[ndarray, " N"]
) -> tuple[Bool[ndarray, " N"], Bool[ndarray, " N"]]:
    """The rows at which a path goes on under another label of the filter's, and those in between
    that have none."""
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


def _named(cut: Paths, names: Int[ndarray, " M"]) -> Int[ndarray, " n"]:
    """The filter's label of each piece; one that it never had keeps its own."""
    labels = cut.labels.copy()
    known = np.flatnonzero(names >= 0)
    owners, first = np.unique(cut.owners[known], return_index=True)
    labels[owners] = names[known[first]]
    return labels


def _runs(paths: Paths, flags: Bool[ndarray, " N"]) -> Int[ndarray, " N"]:
    """The number of the run of equal flags of one path that each row is in."""
    change = np.ones(len(flags), dtype=bool)
    change[1:] = (flags[1:] != flags[:-1]) | (np.diff(paths.owners) != 0)
    return np.asarray(np.cumsum(change) - 1)


def _long_gaps(paths: Paths, fed: Bool[ndarray, " N"], longest: int) -> Bool[ndarray, " N"]:
    """The rows of those runs without a box that are longer than ``longest`` steps."""
    run = _runs(paths, fed)
    return np.asarray(~fed & (np.bincount(run)[run] > longest)) if len(fed) else fed


def _not_bridged(
    paths: Paths, had: Bool[ndarray, " N"], away: Bool[ndarray, " N"], longest: int
) -> Bool[ndarray, " N"]:
    """The rows of the filter's long gaps that the boxes do not lead through from end to end: what
    it lost and went on only for a while may have gone on as another track."""
    gaps = _long_gaps(paths, had, longest)
    run = _runs(paths, had)
    return np.asarray(gaps & (np.bincount(run, away & gaps)[run] > 0.0)) if len(had) else gaps


def _between(paths: Paths, seen: Bool[ndarray, " N"]) -> Bool[ndarray, " N"]:
    """The rows from the first to the last seen one of each path."""
    rows, owners = np.arange(len(seen)), paths.owners
    first = np.full(len(paths.labels), len(seen))
    last = np.full(len(paths.labels), -1)
    np.minimum.at(first, owners[seen], rows[seen])
    np.maximum.at(last, owners[seen], rows[seen])
    return np.asarray((rows >= first[owners]) & (rows <= last[owners]))
