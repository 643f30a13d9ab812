"""Resolution of identities over the whole recording: tracks are split into tracklets and linked.

The tracks of the filter are split where its association marginals were ambiguous, where past
and future contradict each other, and where no camera detected them for long. Each of the
tracklets that remain is of one person; all of them together are linked at the least cost.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence as Many
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.corrections import Correction
from tracker.corrections.constraints import Constraints
from tracker.corrections.kinds import OF_PEOPLE, digest
from tracker.corrections.kinds import leeway as corrections_leeway
from tracker.corrections.outcomes import outcomes
from tracker.geometry.assignment import names_by_majority
from tracker.parameters.groups.smoothing import SmoothingParams
from tracker.smoothing.paths import (
    Links,
    Paths,
    join_chains,
    renumber_rows,
    same_label,
    select_rows,
)
from tracker.smoothing.protocol import Decision, LinkedTracklets, ResultStore, Smoothed
from tracker.smoothing.smoother import BoxAssociations
from tracker.smoothing.tracklets import costs, splitting
from tracker.smoothing.tracklets.appearance import Appearances, sum_by_chain, template_log_odds
from tracker.smoothing.tracklets.constraints import (
    ConstraintResolver,
    constraints_on_chains,
    existence_spans,
    split_by_gap,
)
from tracker.smoothing.tracklets.motion import Ends, Pairs
from tracker.smoothing.tracklets.solver import TrackletGraph, link_tracklets
from tracker.smoothing.tracklets.splitting import Tracked

_CAREFUL_ROUNDS = 3
"""Number of rounds in which an unmet correction is enforced only if no earlier unmet one refers to
the same tracks. Later rounds enforce all unmet ones, since dozens of corrections that depend on
each other would take as many rounds."""

_MOST_REPEATS = 2
"""Largest number of times that the linking is repeated with ends estimated from whole chains. With
0 and 1 mean IDF1 falls by 0.003; with 4 nothing changes."""

_REASONS = {  # by the codes of :class:`tracker.smoothing.tracklets.splitting.Splits`
    0: "past and future do not fit",
    1: "whose boxes these are was near a draw",
    2: "past and future do not fit",
    3: "nobody saw it, or it was not there",
}

_PRIOR_LINK_LOG_ODDS = 8.0
"""Log odds added to a link that is made without any correction: a correction of one link is no
evidence against others. Fifteen true answers raise IDF1 of ``wildtrack-points-300`` from 0.901 to
0.913 with it, and to 0.905 without."""


@dataclass(frozen=True, slots=True, eq=False)
class LinkedTracks:
    """Tracklets linked into n tracks, with N rows."""

    paths: Paths
    """The tracks, interpolated in the gaps."""
    links: Links
    """Association probabilities of their rows and boxes."""
    origins: Int[ndarray, " n"]
    """Index of the path before the splits of which each track has most rows."""
    had: Bool[ndarray, " N"]
    """Whether each row is one of a tracklet; the others fill the gaps between tracklets."""
    names: Int[ndarray, " N"]
    """The filter's label of each row, -1 where it had no track."""
    decisions: list[Decision]
    """Splits and links by which the tracks differ from the filter's."""
    joined: LinkedTracklets
    """The tracklets and the odds of linking them otherwise."""
    limits: dict[int, tuple[int, int]]
    """First and last step at which corrections let a track exist, by its label."""
    people: Int[ndarray, " R"]
    """The label of each row before the splits, -1 where no track has it."""


def link_tracks(tracked: Tracked, parameters: SmoothingParams, seen: Appearances) -> LinkedTracks:
    """Split tracks into tracklets and link these, without any correction.

    Args:
        tracked: Tracks of the filter, or of the previous round, whose states are forgotten.
        parameters: Thresholds of the splits, and weights of the links.
        seen: Appearance of the boxes.
    """
    plain = splitting.find_splits(tracked, parameters)
    tracked.forget_predictions()
    return _link(tracked, parameters, seen, (), 0, plain, PriorLinks(), waits=False)


def link_with_corrections(
    tracked: Tracked,
    parameters: SmoothingParams,
    seen: Appearances,
    corrections: Many[Correction],
    earlier: ResultStore,
    finish: Callable[[LinkedTracks, str], Smoothed],
) -> Smoothed:
    """Split tracks into tracklets and link these, so that all corrections of identity are met.

    Only corrections that the finished tracks without them do not meet are enforced, one after
    another: a correction that confirms the result has no effect. Links that no correction refers
    to remain, as far as possible, those of the result without corrections.

    Args:
        tracked: Tracks of the filter, or of the previous round; without corrections their states
            are forgotten.
        parameters: Thresholds of the splits, and weights of the links.
        seen: Appearance of the boxes.
        corrections: The user's corrections, in the order in which they were made.
        earlier: Results for these tracks under other sets of corrections: with one more
            correction most of the sets that are enforced on the way are the same.
        finish: Makes the finished tracks of linked ones, given a hash of the corrections that are
            enforced. These are what the user sees and corrects: unlike the linked ones they reach
            as far as their boxes do, and lack those that are likelier nobody.
    """
    leeway = corrections_leeway(tracked.smoother.model.step_time)
    waiting = [
        one for one in corrections if one.constraints.must_link or one.constraints.cannot_link
    ]
    plain: splitting.Splits | None = None
    prior_links = PriorLinks()
    turn = 0
    while True:
        obeyed = [one for one in corrections if one not in waiting]
        key = f"linked-{digest(obeyed, OF_PEOPLE)}"
        found: LinkedTracks | None = earlier.get(key)
        if found is None:
            plain = plain or earlier.get("splits") or splitting.find_splits(tracked, parameters)
            earlier.put("splits", plain)
            if not corrections:
                tracked.forget_predictions()
            found = _link(
                tracked, parameters, seen, obeyed, leeway, plain, prior_links,
                waits=bool(corrections),
            )  # fmt: skip
            earlier.put(key, found)
        if prior_links.people is None:
            prior_links = PriorLinks(found.people)
        given = [found]  # nothing else holds the states that the fit replaces
        del found
        if not waiting:
            del tracked
        finished = finish(given.pop(), key)
        unmet = _unmet(finished, waiting, leeway, careful=turn < _CAREFUL_ROUNDS)
        if not unmet:
            return finished
        waiting, turn = [one for one in waiting if one not in unmet], turn + 1


def _unmet(
    tracks: Smoothed, waiting: Many[Correction], leeway: int, *, careful: bool
) -> list[Correction]:
    """Find the corrections that tracks do not meet.

    Args:
        tracks: The finished tracks.
        waiting: The corrections that are not enforced yet.
        leeway: Number of steps by which a track may miss the step of a correction.
        careful: Whether a correction is left out where an unmet earlier one refers to the same
            tracks, since it may be met once that one is enforced.
    """
    if not waiting:
        return []
    results = outcomes(tracks.frames, tracks.labels, tracks.means[:, :3], waiting, leeway=leeway)
    found: list[Correction] = []
    touched: set[int] = set()
    for one, outcome in zip(waiting, results, strict=True):
        if outcome.met:
            continue
        if careful and not outcome.tracks:  # without a track it may refer to any
            return found or [one]
        if not careful or touched.isdisjoint(outcome.tracks):
            found.append(one)
        touched |= set(outcome.tracks)
    return found


def _link(
    tracked: Tracked,
    parameters: SmoothingParams,
    seen: Appearances,
    corrections: Many[Correction],
    leeway: int,
    plain: splitting.Splits,
    prior_links: PriorLinks,
    *,
    waits: bool,
) -> LinkedTracks:
    """Split tracks and link the tracklets under the constraints of some corrections.

    Args:
        tracked: Tracks of the filter, or of the previous round.
        parameters: Thresholds of the splits, and weights of the links.
        seen: Appearance of the boxes.
        corrections: The corrections that are enforced.
        leeway: Number of steps by which a track may miss the step of a correction.
        plain: The splits without corrections.
        prior_links: The links without corrections, which are preferred.
        waits: Whether there are corrections, for which the tracks may be split again.
    """
    smoother, shared, before = tracked.smoother, tracked.shared, tracked.fitted.paths
    rates = plain.rates
    rows_before = len(before.states)
    before = before.without_states()
    resolver = ConstraintResolver(tracked.fitted, corrections, leeway)
    tracklets, source_rows = splitting.split_tracks(tracked, plain, resolver)
    constraints = resolver.constraints(tracklets, source_rows)
    del resolver
    if not waits:
        tracked.forget_states()
    links = select_rows(shared.links, source_rows, rows_before)
    given = [tracklets]  # nothing else holds the states that the fit replaces
    tracklets = tracklets.without_states()
    refitted = smoother.fit(given.pop(), links).without_predictions()
    own = BoxAssociations(
        links,
        shared.chances[:, source_rows],
        shared.missed[:, source_rows],
        shared.hidden_by[:, source_rows],
    )
    worths, births, deaths = costs.tracklet_odds(smoother, refitted, own, parameters, rates)
    del own, shared
    alone = Ends.alone(refitted, smoother.prior)
    short_gap_odds = costs.ShortGapOdds(
        smoother, refitted.paths, links, parameters, seen.embeddings, rates
    )
    pairs = short_gap_odds.pairs(alone)
    people = template_log_odds(refitted.paths, links, smoother, seen, parameters.appearance)
    longest = max(round(parameters.longest / smoother.model.step_time), 1)
    over_short_gaps, over_long_gaps = split_by_gap(constraints, tracklets, longest)

    def best_chains(pairs: Pairs, constraints: Constraints[int]) -> list[list[int]]:
        """Find the most likely chains of tracklets under some constraints."""
        gains = prior_links.gains(pairs, tracklets, source_rows)
        graph = TrackletGraph(-worths, -births, -deaths, pairs.earlier, pairs.later, -gains, people)
        return link_tracklets(graph, constraints)

    first = best_chains(pairs, over_short_gaps)
    for _ in range(_MOST_REPEATS):  # the links improve the estimates at the ends of the tracklets
        several = [chain for chain in first if len(chain) > 1]
        if not several:
            break
        whole, rows = join_chains(refitted.paths, several, list(range(len(several))))
        given = [whole]
        del whole
        of_whole = smoother.fit(given.pop(), renumber_rows(links, rows))
        ends = alone.in_chains(tracklets, of_whole, rows, smoother.model.motion)
        del of_whole
        pairs = short_gap_odds.pairs(ends)
        again = best_chains(pairs, over_short_gaps)
        if again == first:
            break
        first = again
    on_chains = constraints_on_chains(over_long_gaps, first, tracklets)
    if on_chains is None:  # the chains cannot be linked so, since tracklets lie between
        first = best_chains(pairs, constraints)
        on_chains = (
            constraints_on_chains(replace(constraints, must_link=()), first, tracklets)
            or Constraints()
        )
    # chains linked by motion have better embeddings than single tracklets
    long_gap_pairs = costs.long_gap_odds(
        smoother, refitted.paths, links, first, parameters, seen.embeddings, rates
    )
    of_firsts = TrackletGraph(
        np.zeros(len(first)), -births[[c[0] for c in first]], -deaths[[c[-1] for c in first]],
        long_gap_pairs.earlier, long_gap_pairs.later, -long_gap_pairs.gains,
        sum_by_chain(people, first),
    )  # fmt: skip
    on_chains = replace(on_chains, targets=frozenset(range(len(first))))  # accepted above
    chains = [
        [tracklet for number in numbers for tracklet in first[number]]
        for numbers in link_tracklets(of_firsts, on_chains)
    ]
    pairs = Pairs.concatenate([pairs, long_gap_pairs.of_ends(first)])
    labels = _labels(tracklets, chains)
    decisions = split_decisions(tracklets, before, source_rows, plain.reasons, chains, labels)
    decisions += join_decisions(
        tracklets, pairs, chains, labels, rates.restart, set(constraints.must_link)
    )
    paths, rows = join_chains(refitted.paths, chains, labels)
    lengths = np.diff(tracklets.starts)
    origins = [
        _heaviest_value(before.owners[source_rows[tracklets.starts[chain]]], lengths[chain])
        for chain in chains
    ]
    links = renumber_rows(links, rows)
    of_tracklet = np.zeros(len(paths.states), dtype=bool)
    of_tracklet[rows[rows >= 0]] = True
    names_of = np.full(len(paths.states), -1, dtype=np.int64)
    names_of[rows[rows >= 0]] = tracked.names[source_rows[rows >= 0]]
    of_tracklets = np.full(len(tracklets.labels), -1, dtype=np.int64)
    for chain, label in zip(chains, labels, strict=True):
        of_tracklets[chain] = label
    places = refitted.paths.states[:, :3]
    joined = LinkedTracklets(
        of_tracklets, tracklets.firsts, tracklets.lasts,
        places[tracklets.starts[:-1]], places[tracklets.starts[1:] - 1],
        worths, births, deaths, pairs.earlier, pairs.later, pairs.gains,
    )  # fmt: skip
    spans = {labels[k]: span for k, span in existence_spans(constraints, chains, tracklets).items()}
    origins_of = np.array(origins, dtype=np.int64)
    whose = np.full(rows_before, -1, dtype=np.int64)
    whose[source_rows] = of_tracklets[tracklets.owners]
    return LinkedTracks(
        paths, links, origins_of, of_tracklet, names_of, decisions, joined, spans, whose
    )


def _heaviest_value(names: ndarray, weights: ndarray) -> int:
    """Return the value with the largest total weight, the smallest of equal ones."""
    values, which = np.unique(names, return_inverse=True)
    return int(values[np.argmax(np.bincount(which, weights))])


def _labels(tracklets: Paths, chains: list[list[int]]) -> list[int]:
    """Choose the label of each chain: that of most of its rows, unless another chain has more of
    it."""
    lengths = np.diff(tracklets.starts)
    counts = []
    for chain in chains:
        names, which = np.unique(tracklets.labels[chain], return_inverse=True)
        rows = np.bincount(which, lengths[chain]).astype(np.int64)
        counts.append(dict(zip(names.tolist(), rows.tolist(), strict=True)))
    return names_by_majority(counts, int(tracklets.labels.max(initial=0)))


def split_decisions(
    tracklets: Paths,
    before: Paths,
    source_rows: Int[ndarray, " M"],
    reasons: Int[ndarray, " N"],
    chains: list[list[int]],
    labels: list[int],
) -> list[Decision]:
    """List the splits after which a track does not continue as the filter's.

    Args:
        tracklets: The tracklets, with M rows.
        before: The paths before the splits, with N rows.
        source_rows: Index of each of the M rows in ``before``.
        reasons: Why each of the N rows was left out, as in
            :class:`tracker.smoothing.tracklets.splitting.Splits`.
        chains: The tracklets of each track.
        labels: Label of each track.
    """
    chain_of = {tracklet: number for number, chain in enumerate(chains) for tracklet in chain}
    found = []
    for tracklet, after in same_label(tracklets):
        one, other = chain_of.get(tracklet), chain_of.get(after)
        if one is None or one == other:
            continue
        last, first = (
            source_rows[tracklets.starts[tracklet + 1] - 1],
            source_rows[tracklets.starts[after]],
        )
        why = int(np.max(reasons[last + 1 : first], initial=0))
        if (reasons[last + 1 : first] == 1).any():
            why = 1
        step = int(before.steps[first])
        found.append(
            Decision(
                "cut", step, labels[one], int(tracklets.labels[tracklet]), 1.0, 0.0, _REASONS[why]
            )
        )
    return found


def join_decisions(
    tracklets: Paths,
    pairs: Pairs,
    chains: list[list[int]],
    labels: list[int],
    anew: float,
    required: set[tuple[int, int]],
) -> list[Decision]:
    """List the links between tracks of the filter, with the odds against the best alternative.

    Args:
        tracklets: The tracklets.
        pairs: The possible pairs with their log odds.
        chains: The tracklets of each track.
        labels: Label of each track.
        anew: Log probability of a death and a birth instead of a link.
        required: Pairs of tracklets that a correction links.
    """
    gain = {
        (i, j): g
        for i, j, g in zip(
            pairs.earlier.tolist(), pairs.later.tolist(), pairs.gains.tolist(), strict=True
        )
    }
    by_later: dict[int, list[float]] = {}
    for (_, j), g in gain.items():
        by_later.setdefault(j, []).append(g)
    found = []
    for chain, label in zip(chains, labels, strict=True):
        for i, j in pairwise(chain):
            if tracklets.labels[i] == tracklets.labels[j]:
                continue
            if (i, j) in required or (i, j) not in gain:
                name = int(
                    tracklets.labels[j] if tracklets.labels[j] != label else tracklets.labels[i]
                )
                step = int(tracklets.firsts[j])
                found.append(Decision("joined", step, label, name, 1.0, 0.0, "a person said so"))
                continue
            every = np.array([*by_later[j], anew])
            weights = np.exp(every - every.max())
            chances = weights / weights.sum()
            which = int(np.argmin(np.abs(every - gain[i, j])))
            own, rest = float(chances[which]), np.delete(chances, which)
            found.append(
                Decision(
                    "joined",
                    int(tracklets.firsts[j]),
                    label,
                    int(
                        tracklets.labels[j] if tracklets.labels[j] != label else tracklets.labels[i]
                    ),
                    own,
                    float(rest.max(initial=0.0)),
                    "one person goes on"
                    if tracklets.firsts[j] - tracklets.lasts[i] < 2
                    else "one person",
                )
            )
    return found


@dataclass(frozen=True, slots=True, eq=False)
class PriorLinks:
    """The tracks of N rows without any correction, whose links are preferred.

    The optimum under a correction may differ from that without it also in links that the correction
    does not refer to, since the odds of many links are near even. So every link i → j of the
    result without corrections gains s more,

        gain'_ij = gain_ij + s where one track had the end of i and the beginning of j

    and tracklets that a correction separates are linked by their own odds. The preference is the
    same for every set of corrections: after one is undone the others have the result that they
    would have alone.
    """

    people: Int[ndarray, " N"] | None = None
    """The label of each row, -1 where no track has it; None before the first linking."""

    def gains(
        self, pairs: Pairs, tracklets: Paths, source_rows: Int[ndarray, " M"]
    ) -> Float[ndarray, " P"]:
        """Compute the gains of pairs of tracklets, raised for those that were linked.

        Args:
            pairs: P pairs of tracklets with their log odds.
            tracklets: The tracklets, with M rows.
            source_rows: Index of each of the M rows among the N rows.
        """
        if self.people is None or not len(pairs.gains):
            return pairs.gains
        first = self.people[source_rows[tracklets.starts[:-1]]]
        last = self.people[source_rows[tracklets.starts[1:] - 1]]
        stays = (last[pairs.earlier] == first[pairs.later]) & (last[pairs.earlier] >= 0)
        return np.asarray(pairs.gains + _PRIOR_LINK_LOG_ODDS * stays)
