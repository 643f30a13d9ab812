"""Tracks cut into pieces where it is a draw whose boxes are whose, and what joins them again."""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.filters.models import Motion
from tracker.smoothing.identity.ends import Ends
from tracker.smoothing.paths import Links, Paths

_CHANGES = 0.1
"""Probability that somebody begins to move as the motion model says while nobody sees him."""


def contested(paths: Paths, links: Links) -> Float[ndarray, " N"]:
    """By which share the boxes of each row may as well be another path's.

        Σ_z min(a_i(z), max_{j≠i} a_j(z)) / Σ_z a_i(z)

    over the boxes z of all cameras with association probabilities a: 0 where they are nobody
    else's, 1 where they are somebody else's just as well.
    """
    rows = len(paths.states)
    own = np.bincount(links.rows, links.shares, rows)
    if not len(links.rows):
        return np.zeros(rows)
    order = np.lexsort((-links.shares, links.boxes, links.cameras))
    camera, box, share = links.cameras[order], links.boxes[order], links.shares[order]
    first = np.ones(len(order), dtype=bool)
    first[1:] = (np.diff(camera) != 0) | (np.diff(box) != 0)
    leader = np.maximum.accumulate(np.where(first, np.arange(len(order)), 0))
    follows = np.zeros(len(order))
    second = np.flatnonzero(~first & (leader == np.arange(len(order)) - 1))
    follows[leader[second]] = share[second]
    rival = np.where(first, follows[leader], share[leader])
    lost = np.bincount(links.rows[order], np.minimum(share, rival), rows)
    return np.asarray(np.where(own > 0.0, lost / np.maximum(own, 1e-12), 0.0))


def cut(
    paths: Paths, clear: Bool[ndarray, " N"], breaks: Bool[ndarray, " N"]
) -> tuple[Paths, Int[ndarray, " M"]]:
    """The runs of clear rows as paths of their own, and which row each of their rows was.

    Args:
        paths: What is cut.
        clear: Rows that are kept.
        breaks: Rows before which a path is cut even where both sides are clear.
    """
    kept = np.flatnonzero(clear)
    owners = paths.owners[kept]
    begins = np.ones(len(kept), dtype=bool)
    begins[1:] = (np.diff(kept) > 1) | (np.diff(owners) != 0) | breaks[kept[1:]]
    firsts = np.flatnonzero(begins)
    starts = np.append(firsts, len(kept)).astype(np.int64)
    return (
        Paths(
            paths.labels[owners[firsts]],
            paths.steps[kept[firsts]],
            starts,
            paths.states[kept],
            paths.covariances[kept],
        ),
        kept,
    )


def moved(links: Links, kept: Int[ndarray, " M"], rows: int) -> Links:
    """The links of rows that were kept, by their new rows."""
    place = np.full(rows, -1, dtype=np.int64)
    place[kept] = np.arange(len(kept))
    return moved_to(links, place)


def moved_to(links: Links, place: Int[ndarray, " N"]) -> Links:
    """The links of rows that have a new place, -1 for none, by that place."""
    new = place[links.rows]
    chosen = links.take(new >= 0)
    return Links(chosen.cameras, new[new >= 0], chosen.boxes, chosen.shares)


@dataclass(frozen=True, slots=True, eq=False)
class Pairs:
    """P pairs of pieces that may be one person's, the first before the second."""

    earlier: Int[ndarray, " P"]
    later: Int[ndarray, " P"]
    gaps: Int[ndarray, " P"]
    """Steps from the end of the one to the beginning of the other, at least 1."""
    gains: Float[ndarray, " P"]
    """log of how much better the second fits as the first's continuation than anywhere."""

    def of_ends(self, chains: Many[Many[int]]) -> Pairs:
        """Pairs of chains as pairs of the last piece of the one and the first of the other."""
        first = np.array([chain[0] for chain in chains], dtype=np.int64)
        last = np.array([chain[-1] for chain in chains], dtype=np.int64)
        return Pairs(last[self.earlier], first[self.later], self.gaps, self.gains)

    def with_more(self, more: Pairs) -> Pairs:
        """These and others."""
        return Pairs(
            np.concatenate([self.earlier, more.earlier]),
            np.concatenate([self.later, more.later]),
            np.concatenate([self.gaps, more.gaps]),
            np.concatenate([self.gains, more.gains]),
        )


def near_pairs(pieces: Paths, *, longest: int, fastest: float) -> Pairs:
    """The pairs that may be one person's by when and where they are, with gains of 0.

    Args:
        pieces: Of tracks.
        longest: Steps of the longest gap.
        fastest: Metres a step that nobody exceeds.
    """
    ends, begins = pieces.starts[1:] - 1, pieces.starts[:-1]
    lasts, firsts = pieces.lasts, pieces.firsts
    order = np.argsort(firsts, kind="stable")
    low = np.searchsorted(firsts[order], lasts, side="right")
    high = np.searchsorted(firsts[order], lasts + longest, side="right")
    earlier = np.repeat(np.arange(len(lasts)), high - low)
    offset = np.arange(len(earlier)) - np.repeat(np.cumsum(high - low) - (high - low), high - low)
    later = order[np.repeat(low, high - low) + offset] if len(earlier) else earlier
    gaps = firsts[later] - lasts[earlier]
    way = pieces.states[begins[later], :3] - pieces.states[ends[earlier], :3]
    near = np.linalg.norm(way, axis=1) <= 1.0 + fastest * gaps
    # as the filter had it is always possible: it may have followed another before
    goes_on = np.full(len(lasts), -1)
    for one, other in same_label(pieces):
        goes_on[one] = other
    near |= goes_on[earlier] == later
    return Pairs(earlier[near], later[near], gaps[near], np.zeros(int(near.sum())))


def motion_gains(
    pieces: Paths,
    pairs: Pairs,
    known: Ends,
    motion: Motion,
    prior: Float[ndarray, "d d"],
    log_place: float,
) -> Float[ndarray, " P"]:
    """The motion's log odds of pairs of pieces.

    With Λ, η the information of what is from the later piece's beginning on, and N(a, A_s) the
    earlier one's last state predicted over the gap by a motion with noise s Q,

        gain = log Σ_s w_s ∫ N(x; a, A_s) e^{ηᵀx − ½ xᵀΛx} dx − log ∫ p_0(x) e^{ηᵀx − ½ xᵀΛx} dx

    with the density p_0 of a newcomer: anywhere in the room, at a newcomer's speed. The person is
    mostly as restless as before and after, s = √(s_i s_j), and else no less than the motion says.

    Args:
        pieces: Each fitted to its own boxes alone.
        pairs: Of them.
        known: Of their ends.
        motion: Of the fusion.
        prior: Covariance of a first state in the fit.
        log_place: What turns its density into that of the room.
    """
    earlier, later, gaps = pairs.earlier, pairs.later, pairs.gaps
    begins = pieces.starts[:-1]
    # F^k, and the noise that k steps add
    d = motion.dimension
    most = int(gaps.max(initial=1))
    transitions, noises = np.empty((most + 1, d, d)), np.zeros((most + 1, d, d))
    transitions[0] = np.eye(d)
    for k in range(most):
        transitions[k + 1] = motion.transition @ transitions[k]
        noises[k + 1] = motion.transition @ noises[k] @ motion.transition.T + motion.noise
    f = transitions[gaps]
    a = np.einsum("pij,pj->pi", f, known.ends[earlier])
    spread = f @ known.covariances[earlier] @ f.transpose(0, 2, 1)
    own = np.sqrt(known.restlessness[earlier, 1] * known.restlessness[later, 0])
    told = known.information[later], known.vectors[later]
    centre = pieces.states[begins].copy()
    centre[:, 3:] = 0.0
    newcomer = log_integral(
        centre,
        np.broadcast_to(prior, known.information.shape),
        known.information,
        known.vectors,
    )
    gains = np.logaddexp(
        *(
            np.log(weight) + log_integral(a, spread + s[:, None, None] * noises[gaps], *told)
            for weight, s in ((1.0 - _CHANGES, own), (_CHANGES, np.maximum(own, 1.0)))
        )
    )
    return np.asarray(gains - (newcomer[later] + log_place))


def log_integral(
    means: Float[ndarray, "P d"],
    covariances: Float[ndarray, "P d d"],
    information: Float[ndarray, "P d d"],
    vectors: Float[ndarray, "P d"],
) -> Float[ndarray, " P"]:
    """log ∫ N(x; m, P) e^{ηᵀx − ½ xᵀΛx} dx."""
    if not len(means):
        return np.zeros(0)
    bracket = np.eye(means.shape[1]) + information @ covariances
    told = vectors - np.einsum("pij,pj->pi", information, means)
    shift = np.einsum("pij,pj->pi", covariances, np.linalg.solve(bracket, told[..., None])[..., 0])
    _, log_determinant = np.linalg.slogdet(bracket)
    fixed = np.einsum("pi,pi->p", means, vectors)
    fixed -= 0.5 * np.einsum("pi,pij,pj->p", means, information, means)
    return np.asarray(fixed + 0.5 * np.einsum("pi,pi->p", told, shift) - 0.5 * log_determinant)


def same_label(paths: Paths) -> list[tuple[int, int]]:
    """Each piece and the next one that has the same label of the filter's."""
    order = np.lexsort((paths.firsts, paths.labels))
    one, other = order[:-1], order[1:]
    same = (paths.labels[one] == paths.labels[other]) & (paths.lasts[one] < paths.firsts[other])
    return list(zip(one[same].tolist(), other[same].tolist(), strict=True))


def chained(
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
