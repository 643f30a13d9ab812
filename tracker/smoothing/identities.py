"""Who is who over the whole recording: tracks cut where it was a draw, and joined again.

The tracks of the filter are cut where its association marginals were near a draw, where past
and future contradict each other, and where nobody saw them for long. What is left are pieces
that are surely one person's; all of them together are joined at the least cost.
"""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.special import logsumexp

from tracker.assignment import names_by_majority
from tracker.corrections import Correction
from tracker.corrections.kinds import leeway as corrections_leeway
from tracker.fusion import visibility
from tracker.kernels.smoothing import evidence
from tracker.parameters import SmoothingParams
from tracker.smoothing import joining, pieces
from tracker.smoothing.appearance import Appearance
from tracker.smoothing.exchanges import exchange_breaks
from tracker.smoothing.lifetimes import independence, lifetimes, misses
from tracker.smoothing.paths import Links, Paths
from tracker.smoothing.pieces import Pairs
from tracker.smoothing.result import Decision, Joined
from tracker.smoothing.smoother import Fitted, Shared, Smoother
from tracker.smoothing.ties import Seeker, Ties

_FED = 0.3
"""Boxes, of all cameras together, from which a row counts as seen."""

_AROUND = 0.2
"""Seconds around a jump that belong to neither side."""

_SHORTEST = 0.4
"""Seconds of a piece that stands for itself; a shorter one, beside longer ones, is left out."""

_SURE = 1e6
"""Log odds of chains that were found somebody's already."""

_FASTEST = 3.0
"""Metres a second that nobody in a room exceeds for long."""


@dataclass(frozen=True, slots=True, eq=False)
class Settled:
    """Pieces joined into the tracks of people."""

    paths: Paths
    links: Links
    origins: Int[ndarray, " n"]
    """The path before the cuts of which each has most."""
    had: Bool[ndarray, " N"]
    """The rows of pieces: the others are of the gaps between them."""
    names: Int[ndarray, " N"]
    """The filter's label of each row, -1 where it had nobody."""
    decisions: list[Decision]
    joined: Joined
    limits: dict[int, tuple[int, int]]
    """Of some labels the first and the last step at which corrections let them be."""


def settle(
    smoother: Smoother,
    fitted: Fitted,
    shared: Shared,
    contested: Float[ndarray, " N"],
    had: Bool[ndarray, " N"],
    names: Int[ndarray, " N"],
    parameters: SmoothingParams,
    looks: Many[Float[ndarray, "B A"]] | None,
    corrections: Many[Correction] = (),
) -> Settled:
    """Cut and join.

    Args:
        smoother: The models.
        fitted: The filter's tracks, or what was made of them before, fitted to their boxes.
        shared: Whose box each is.
        contested: By which share each row's boxes were as well another's.
        had: At which rows there was a track before.
        names: The filter's label of each row, -1 where it had nobody.
        parameters: When to cut, and what holds together.
        looks: A unit vector for each box of each camera; None where there is none.
        corrections: What a person said of who is who.
    """
    seeker = Seeker(fitted.paths, corrections, corrections_leeway(smoother.model.step_time))
    cut, kept, reasons = _cut(smoother, fitted, shared, contested, had, names, parameters, seeker)
    ties = seeker.ties(cut, kept)
    links = pieces.moved(shared.links, kept, len(fitted.paths.states))
    refitted = smoother.fit(cut, links)
    own = Shared(links, shared.chances[:, kept], shared.missed[:, kept], shared.hidden_by[:, kept])
    worths, births, deaths = _odds(smoother, refitted, own, parameters)
    pairs = _goes_on(smoother, refitted.paths, links, parameters, looks)
    longest = max(round(parameters.longest / smoother.model.step_time), 1)
    now, later = ties.parted(cut, longest)
    following, used = joining.join(
        worths, births, deaths, pairs.earlier, pairs.later, pairs.gains, now
    )
    first = joining.chains(following, used)
    of_chains = later.of_chains(first, cut)
    if of_chains is None:  # who is tied to somebody far away may not be joined to another meanwhile
        following, used = joining.join(
            worths, births, deaths, pairs.earlier, pairs.later, pairs.gains, ties
        )
        first = joining.chains(following, used)
        of_chains = Ties(apart=ties.apart).of_chains(first, cut) or Ties()
    # what goes on by its motion tells more of its looks than each piece alone
    back = _comes_back(smoother, refitted.paths, links, first, parameters, looks)
    following, _ = joining.join(
        np.full(len(first), _SURE), births[[c[0] for c in first]], deaths[[c[-1] for c in first]],
        back.earlier, back.later, back.gains, of_chains,
    )  # fmt: skip
    chains = [
        [piece for number in numbers for piece in first[number]]
        for numbers in joining.chains(following, np.ones(len(first), dtype=bool))
    ]
    pairs = pairs.with_more(back.of_ends(first))
    labels = _labels(cut, chains)
    decisions = _cuts(cut, fitted.paths, kept, reasons, chains, labels)
    decisions += _joins(cut, pairs, chains, labels, _anew(smoother), set(ties.together))
    paths, rows = _chained(refitted.paths, chains, labels)
    lengths = np.diff(cut.starts)
    origins = [
        _most(fitted.paths.owners[kept[cut.starts[chain]]], lengths[chain]) for chain in chains
    ]
    links = pieces.moved_to(links, rows)
    of_piece = np.zeros(len(paths.states), dtype=bool)
    of_piece[rows[rows >= 0]] = True
    names_of = np.full(len(paths.states), -1, dtype=np.int64)
    names_of[rows[rows >= 0]] = names[kept[rows >= 0]]
    of_pieces = np.full(len(cut.labels), -1, dtype=np.int64)
    for chain, label in zip(chains, labels, strict=True):
        of_pieces[chain] = label
    places = refitted.paths.states[:, :3]
    joined = Joined(
        of_pieces, cut.firsts, cut.lasts, places[cut.starts[:-1]], places[cut.starts[1:] - 1],
        worths, births, deaths, pairs.earlier, pairs.later, pairs.gains,
    )  # fmt: skip
    limits = {labels[k]: span for k, span in ties.limits(chains, cut).items()}
    origins_of = np.array(origins, dtype=np.int64)
    return Settled(paths, links, origins_of, of_piece, names_of, decisions, joined, limits)


def _cut(
    smoother: Smoother,
    fitted: Fitted,
    shared: Shared,
    contested: Float[ndarray, " N"],
    had: Bool[ndarray, " N"],
    names: Int[ndarray, " N"],
    p: SmoothingParams,
    seeker: Seeker,
) -> tuple[Paths, Int[ndarray, " M"], Int[ndarray, " N"]]:
    """The pieces under the filter's labels, the row that each of their rows was, and why each row
    was left out: 0 for not, 1 contested, 2 jump, 3 away or not seen."""
    step_time, paths = smoother.model.step_time, fitted.paths
    rows = len(paths.states)
    there, _ = lifetimes(smoother, paths, shared, p)
    reasons = np.zeros(rows, dtype=np.int64)
    fed = np.bincount(shared.links.rows, shared.links.shares, rows) > _FED
    fed[smoother.pinned(paths)[0]] = True
    too_long = round(p.gap / step_time)
    away = _long_gaps(paths, fed, too_long) | (there < 0.5)
    reasons[away | _not_bridged(paths, had, away, too_long)] = 3
    around = round(_AROUND / step_time)
    # where boxes err alike for a while, past and future contradict each other by less than it seems
    jumps = np.flatnonzero(fitted.jumps * independence(step_time, p.memory) > p.jump)
    owners = paths.owners
    for offset in range(-around, around):
        near = np.clip(jumps + offset, 0, rows - 1)
        near = near[owners[near] == owners[jumps]]
        reasons[near] = 2
    reasons[contested >= p.doubt] = 1
    breaks = np.zeros(rows, dtype=bool)
    breaks[jumps] = True
    breaks |= exchange_breaks(
        fitted, reach=1.0 + _FASTEST * step_time, least=p.exchange, apart=too_long
    )
    breaks |= seeker.breaks()
    clear = _between(paths, fed & (reasons == 0)) & (reasons == 0)
    begins, between = _of_two(paths, names)
    breaks |= begins
    clear &= ~between
    cut, kept = pieces.cut(paths, clear, breaks)
    if len(more := seeker.overlaps(cut, kept)):
        breaks[more] = True
        cut, kept = pieces.cut(paths, clear, breaks)
    # a short piece says little of who it is; where it is all there is it stays
    lengths = np.diff(cut.starts)
    of = owners[kept[cut.starts[:-1]]]
    longest = np.zeros(len(paths.labels), dtype=np.int64)
    np.maximum.at(longest, of, lengths)
    shortest = round(_SHORTEST / step_time)
    short = (lengths < shortest) & (longest[of] >= shortest)
    short[list(seeker.meant(cut, kept))] = False
    clear[kept[np.repeat(short, lengths)]] = False
    cut, kept = pieces.cut(paths, clear, breaks)
    return replace(cut, labels=_named(cut, names[kept])), kept, reasons


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


def _odds(
    smoother: Smoother, fitted: Fitted, shared: Shared, parameters: SmoothingParams
) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"], Float[ndarray, " n"]]:
    """Of each piece: the log odds of its boxes against clutter, of its birth and of its death."""
    step_time, paths = smoother.model.step_time, fitted.paths
    count = len(paths.labels)
    survival, death = _survival(smoother)
    rows = fitted.odds + independence(step_time, parameters.memory) * misses(shared) + survival
    worths = np.bincount(paths.owners, rows, count) + smoother.log_place
    births = np.where(paths.firsts <= 0, 0.0, _anew(smoother) - death)
    deaths = np.where(paths.lasts >= smoother.frames - 1, 0.0, death)
    return worths, births, deaths


def _survival(smoother: Smoother) -> tuple[float, float]:
    """log p_S and log(1 − p_S)."""
    survival = min(smoother.parameters.survival_probability, 1.0 - 1e-6)
    return float(np.log(survival)), float(np.log1p(-survival))


def _anew(smoother: Smoother) -> float:
    """log of the probability that somebody comes at a step, and of that somebody leaves at it."""
    rate = smoother.parameters.birth_rate * smoother.model.step_time
    return float(np.log(rate)) + _survival(smoother)[1]


def _goes_on(
    smoother: Smoother,
    paths: Paths,
    links: Links,
    p: SmoothingParams,
    looks: Many[Float[ndarray, "B A"]] | None,
) -> Pairs:
    """Every pair of pieces of which the second may continue the first, with its gain: by their
    motion over a short gap, and their looks. The label that the filter gave both says nothing
    more: it came of the same boxes."""
    step_time, count = smoother.model.step_time, len(paths.labels)
    survival, _ = _survival(smoother)
    longest = max(round(p.longest / step_time), 1)
    motion = pieces.motion_pairs(
        paths,
        smoother.model.motion,
        smoother.prior,
        smoother.log_place,
        longest=longest,
        fastest=_FASTEST * step_time,
    )
    told = motion.gains + motion.gaps * survival + _seen_empty(smoother, paths, motion, p.memory)
    if looks is not None:
        alike = Appearance(paths, links, smoother.cameras, looks, step_time)
        told += p.appearance * alike.log_ratio(motion.earlier, motion.later)[0]
    gains = np.full((count, count), -np.inf)
    gains[motion.earlier, motion.later] = told
    return _of_table(gains, paths)


def _comes_back(
    smoother: Smoother,
    paths: Paths,
    links: Links,
    chains: list[list[int]],
    p: SmoothingParams,
    looks: Many[Float[ndarray, "B A"]] | None,
) -> Pairs:
    """Every pair of chains of which the second may be the first, gone for a while and back: one of
    those who left, by the looks, and by the label that the filter gave pieces of both."""
    whole, rows = _chained(paths, chains, list(range(len(chains))))
    anew = _anew(smoother)
    before = whole.lasts[:, None] < whole.firsts[None, :]
    gains = np.full(before.shape, -np.inf)
    if looks is not None:
        own = pieces.moved_to(links, rows)
        alike = Appearance(whole, own, smoother.cameras, looks, smoother.model.step_time)
        gone = np.maximum(before.sum(axis=0), 1)
        earlier, later = np.nonzero(before)
        ratio, known = alike.log_ratio(earlier, later)
        earlier, later, ratio = earlier[known], later[known], ratio[known]
        gains[earlier, later] = anew - np.log(gone[later]) + p.appearance * ratio
    chain_of = {piece: number for number, chain in enumerate(chains) for piece in chain}
    for one, other in _same_label(paths):
        i, j = chain_of.get(one, -1), chain_of.get(other, -1)
        if min(i, j) >= 0 and before[i, j]:
            gains[i, j] = max(gains[i, j], anew) + p.keeping
    return _of_table(gains, whole)


def _same_label(paths: Paths) -> list[tuple[int, int]]:
    """Each piece and the next one that has the same label of the filter's."""
    order = np.lexsort((paths.firsts, paths.labels))
    one, other = order[:-1], order[1:]
    same = (paths.labels[one] == paths.labels[other]) & (paths.lasts[one] < paths.firsts[other])
    return list(zip(one[same].tolist(), other[same].tolist(), strict=True))


def _of_table(gains: Float[ndarray, "n n"], paths: Paths) -> Pairs:
    """The pairs that are possible."""
    earlier, later = np.nonzero(np.isfinite(gains))
    gaps = paths.firsts[later] - paths.lasts[earlier]
    return Pairs(earlier, later, gaps, gains[earlier, later])


def _seen_empty(
    smoother: Smoother, paths: Paths, pairs: Pairs, memory: float
) -> Float[ndarray, " P"]:
    """What the cameras say of the ways between the pieces of each pair: at most 0.

    A camera that looks at the straight way in between and has no box there speaks against
    somebody; one that has a box, his or of who hides him, says nothing.
    """
    inner = pairs.gaps - 1
    told = np.zeros(len(inner))
    pair = np.repeat(np.arange(len(inner)), inner)
    step = np.arange(len(pair)) - np.repeat(np.cumsum(inner) - inner, inner) + 1
    begin = paths.states[paths.starts[1:][pairs.earlier] - 1][pair]
    end = paths.states[paths.starts[:-1][pairs.later]][pair]
    share = (step / pairs.gaps[pair])[:, None]
    states = begin * (1.0 - share) + end * share
    spread = np.zeros((len(pair), states.shape[1], states.shape[1]))
    steps = paths.lasts[pairs.earlier][pair] + step
    model, p = smoother.model, smoother.parameters
    for c, camera in enumerate(smoother.cameras):
        expected = model.target.expected(model.cameras[c], states, spread)
        chances = p.detection_probability * visibility.inside_probability(
            model.cameras[c], expected, spread, soft=p.edge == "soft"
        )
        chances = np.where(camera.blind[steps], 0.0, chances)
        against = evidence.seen_empty(
            expected.boxes, expected.valid, chances, steps, camera.starts, camera.boxes
        )
        told += np.bincount(pair, against, len(inner))
    return told * independence(model.step_time, memory)


def _most(names: ndarray, weights: ndarray) -> int:
    """The name with most weight, of equal ones the smallest."""
    values, which = np.unique(names, return_inverse=True)
    return int(values[np.argmax(np.bincount(which, weights))])


def _labels(cut: Paths, chains: list[list[int]]) -> list[int]:
    """A label for each chain: that of most of its rows, where no other chain has more of it."""
    lengths = np.diff(cut.starts)
    counts = []
    for chain in chains:
        names, which = np.unique(cut.labels[chain], return_inverse=True)
        rows = np.bincount(which, lengths[chain]).astype(np.int64)
        counts.append(dict(zip(names.tolist(), rows.tolist(), strict=True)))
    return names_by_majority(counts, int(cut.labels.max(initial=0)))


def _chained(
    cut: Paths, chains: list[list[int]], labels: list[int]
) -> tuple[Paths, Int[ndarray, " M"]]:
    """The chains as paths, drawn straight through their gaps, and each row's place in them."""
    dimension = cut.states.shape[1]
    steps, place = cut.steps, np.full(len(cut.states), -1, dtype=np.int64)
    firsts, states, covariances, begin = [], [], [], 0
    for chain in chains:
        rows = np.concatenate([np.arange(cut.starts[k], cut.starts[k + 1]) for k in chain])
        own = steps[rows]
        every = np.arange(own[0], own[-1] + 1)
        states.append(
            np.stack([np.interp(every, own, cut.states[rows, a]) for a in range(dimension)], axis=1)
        )
        spread = np.tile(np.eye(dimension), (len(every), 1, 1))
        spread[own - own[0]] = cut.covariances[rows]
        covariances.append(spread)
        firsts.append(int(own[0]))
        place[rows] = begin + own - own[0]
        begin += len(every)
    return Paths.of(labels, firsts, states, covariances, dimension), place


_REASONS = {
    0: "past and future do not fit",
    1: "whose boxes these are was near a draw",
    2: "past and future do not fit",
    3: "nobody saw it, or it was not there",
}


def _cuts(
    cut: Paths,
    before: Paths,
    kept: Int[ndarray, " M"],
    reasons: Int[ndarray, " N"],
    chains: list[list[int]],
    labels: list[int],
) -> list[Decision]:
    """The cuts after which a track did not go on as the filter had it."""
    chain_of = {piece: number for number, chain in enumerate(chains) for piece in chain}
    found = []
    for piece, after in _same_label(cut):
        one, other = chain_of.get(piece), chain_of.get(after)
        if one is None or one == other:
            continue
        last, first = kept[cut.starts[piece + 1] - 1], kept[cut.starts[after]]
        why = int(np.max(reasons[last + 1 : first], initial=0))
        if (reasons[last + 1 : first] == 1).any():
            why = 1
        step = int(before.steps[first])
        found.append(
            Decision("cut", step, labels[one], int(cut.labels[piece]), 1.0, 0.0, _REASONS[why])
        )
    return found


def _joins(
    cut: Paths,
    pairs: Pairs,
    chains: list[list[int]],
    labels: list[int],
    anew: float,
    told: set[tuple[int, int]],
) -> list[Decision]:
    """The joins of what the filter held for two people, with the odds against the best other."""
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
            if cut.labels[i] == cut.labels[j]:
                continue
            if (i, j) in told or (i, j) not in gain:
                name = int(cut.labels[j] if cut.labels[j] != label else cut.labels[i])
                step = int(cut.firsts[j])
                found.append(Decision("joined", step, label, name, 1.0, 0.0, "a person said so"))
                continue
            every = np.array([*by_later[j], anew])
            chances = np.exp(every - logsumexp(every))
            own = float(np.exp(gain[i, j] - logsumexp(every)))
            rest = np.delete(chances, int(np.argmin(np.abs(every - gain[i, j]))))
            found.append(
                Decision(
                    "joined",
                    int(cut.firsts[j]),
                    label,
                    int(cut.labels[j] if cut.labels[j] != label else cut.labels[i]),
                    own,
                    float(rest.max(initial=0.0)),
                    "one person goes on" if cut.firsts[j] - cut.lasts[i] < 2 else "one person",
                )
            )
    return found
