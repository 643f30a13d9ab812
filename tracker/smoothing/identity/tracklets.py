"""Tracklets: parts of tracks without ambiguous association, and the motion odds of linking them."""

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
"""Probability that a person's process noise returns to the model's within a gap."""


def contested(paths: Paths, links: Links) -> Float[ndarray, " N"]:
    """Compute the share of each row's boxes that may belong to another path as well.

        Σ_z min(a_i(z), max_{j≠i} a_j(z)) / Σ_z a_i(z)

    over the boxes z of all cameras with association probabilities a: 0 where they belong to no
    other path, 1 where another path is at least as likely.
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


def split_paths(
    paths: Paths, clear: Bool[ndarray, " N"], breaks: Bool[ndarray, " N"]
) -> tuple[Paths, Int[ndarray, " M"]]:
    """Split paths into the runs of clear rows.

    Args:
        paths: The paths, with N rows.
        clear: The rows that remain.
        breaks: The rows before which a path is split even where both sides are clear.

    Returns:
        The runs as paths with M rows, and the index of each of these rows in ``paths``.
    """
    source_rows = np.flatnonzero(clear)
    owners = paths.owners[source_rows]
    begins = np.ones(len(source_rows), dtype=bool)
    begins[1:] = (np.diff(source_rows) > 1) | (np.diff(owners) != 0) | breaks[source_rows[1:]]
    firsts = np.flatnonzero(begins)
    starts = np.append(firsts, len(source_rows)).astype(np.int64)
    return (
        Paths(
            paths.labels[owners[firsts]],
            paths.steps[source_rows[firsts]],
            starts,
            paths.states[source_rows],
            paths.covariances[source_rows],
        ),
        source_rows,
    )


def select_rows(links: Links, source_rows: Int[ndarray, " M"], rows: int) -> Links:
    """Select the links of M of N rows, and renumber the rows.

    Args:
        links: Links of N rows.
        source_rows: Index of each of the M rows among the N.
        rows: N, the number of rows before the selection.
    """
    place = np.full(rows, -1, dtype=np.int64)
    place[source_rows] = np.arange(len(source_rows))
    return renumber_rows(links, place)


def renumber_rows(links: Links, place: Int[ndarray, " N"]) -> Links:
    """Renumber the links by the new index of each row, -1 for rows whose links are removed."""
    new = place[links.rows]
    chosen = links.take(new >= 0)
    return Links(chosen.cameras, new[new >= 0], chosen.boxes, chosen.shares)


@dataclass(frozen=True, slots=True, eq=False)
class Pairs:
    """P pairs of tracklets that may be linked, the first before the second."""

    earlier: Int[ndarray, " P"]
    """Index of the first tracklet."""
    later: Int[ndarray, " P"]
    """Index of the second tracklet."""
    gaps: Int[ndarray, " P"]
    """Number of steps from the end of the first to the beginning of the second, at least 1."""
    gains: Float[ndarray, " P"]
    """Log odds of the second continuing the first against being a new target."""

    def take(self, chosen: ndarray) -> Pairs:
        """Select some of the pairs, by mask or index."""
        return Pairs(
            self.earlier[chosen], self.later[chosen], self.gaps[chosen], self.gains[chosen]
        )

    def of_ends(self, chains: Many[Many[int]]) -> Pairs:
        """Convert pairs of chains to pairs of one's last tracklet and the other's first."""
        first = np.array([chain[0] for chain in chains], dtype=np.int64)
        last = np.array([chain[-1] for chain in chains], dtype=np.int64)
        return Pairs(last[self.earlier], first[self.later], self.gaps, self.gains)

    def with_more(self, more: Pairs) -> Pairs:
        """Append other pairs."""
        return Pairs(
            np.concatenate([self.earlier, more.earlier]),
            np.concatenate([self.later, more.later]),
            np.concatenate([self.gaps, more.gaps]),
            np.concatenate([self.gains, more.gains]),
        )


def near_pairs(tracklets: Paths, *, longest: int, fastest: float) -> Pairs:
    """List the pairs that are possible by time and distance, with gains of 0.

    Args:
        tracklets: The n tracklets.
        longest: Longest gap, steps.
        fastest: Largest speed, metres per step.
    """
    ends, begins = tracklets.starts[1:] - 1, tracklets.starts[:-1]
    lasts, firsts = tracklets.lasts, tracklets.firsts
    order = np.argsort(firsts, kind="stable")
    low = np.searchsorted(firsts[order], lasts, side="right")
    high = np.searchsorted(firsts[order], lasts + longest, side="right")
    earlier = np.repeat(np.arange(len(lasts)), high - low)
    offset = np.arange(len(earlier)) - np.repeat(np.cumsum(high - low) - (high - low), high - low)
    later = order[np.repeat(low, high - low) + offset] if len(earlier) else earlier
    gaps = firsts[later] - lasts[earlier]
    way = tracklets.states[begins[later], :3] - tracklets.states[ends[earlier], :3]
    near = np.linalg.norm(way, axis=1) <= 1.0 + fastest * gaps
    # a pair with one label of the filter is always possible
    goes_on = np.full(len(lasts), -1)
    for one, other in same_label(tracklets):
        goes_on[one] = other
    near |= goes_on[earlier] == later
    return Pairs(earlier[near], later[near], gaps[near], np.zeros(int(near.sum())))


def motion_gains(
    tracklets: Paths,
    pairs: Pairs,
    known: Ends,
    motion: Motion,
    prior: Float[ndarray, "d d"],
    log_place: float,
) -> Float[ndarray, " P"]:
    """Compute the log odds of pairs of tracklets by motion.

    With Λ, η the information on the first state of the later tracklet, and N(a, A_s) the last
    state of the earlier one predicted over the gap with process noise s Q,

        gain = log Σ_s w_s ∫ N(x; a, A_s) e^{ηᵀx − ½ xᵀΛx} dx − log ∫ p_0(x) e^{ηᵀx − ½ xᵀΛx} dx

    with the density p_0 of a new target: uniform in the room, with the velocity of a birth. The
    scale s of the process noise is with probability 0.9 that before and after, s = √(s_i s_j),
    and else at least 1.

    Args:
        tracklets: The n tracklets, each fitted to its own boxes alone.
        pairs: P pairs of these.
        known: Estimates at the ends of the tracklets.
        motion: The motion model of the fusion.
        prior: Prior covariance of a first state in the fit.
        log_place: Log ratio of the uniform density over the room and the density of the prior.
    """
    earlier, later, gaps = pairs.earlier, pairs.later, pairs.gaps
    begins = tracklets.starts[:-1]
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
    own = np.sqrt(known.noise_scales[earlier, 1] * known.noise_scales[later, 0])
    later_ends = known.information[later], known.vectors[later]
    centre = tracklets.states[begins].copy()
    centre[:, 3:] = 0.0
    newcomer = log_integral(
        centre,
        np.broadcast_to(prior, known.information.shape),
        known.information,
        known.vectors,
    )
    gains = np.logaddexp(
        *(
            np.log(weight) + log_integral(a, spread + s[:, None, None] * noises[gaps], *later_ends)
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
    """Compute log ∫ N(x; m, P) e^{ηᵀx − ½ xᵀΛx} dx for P Gaussians and information pairs."""
    if not len(means):
        return np.zeros(0)
    bracket = np.eye(means.shape[1]) + information @ covariances
    residual = vectors - np.einsum("pij,pj->pi", information, means)
    shift = np.einsum(
        "pij,pj->pi", covariances, np.linalg.solve(bracket, residual[..., None])[..., 0]
    )
    _, log_determinant = np.linalg.slogdet(bracket)
    fixed = np.einsum("pi,pi->p", means, vectors)
    fixed -= 0.5 * np.einsum("pi,pij,pj->p", means, information, means)
    return np.asarray(fixed + 0.5 * np.einsum("pi,pi->p", residual, shift) - 0.5 * log_determinant)


def same_label(paths: Paths) -> list[tuple[int, int]]:
    """List the pairs of each tracklet and the next one in time with the same label of the
    filter."""
    order = np.lexsort((paths.firsts, paths.labels))
    one, other = order[:-1], order[1:]
    same = (paths.labels[one] == paths.labels[other]) & (paths.lasts[one] < paths.firsts[other])
    return list(zip(one[same].tolist(), other[same].tolist(), strict=True))


def join_chains(
    tracklets: Paths, chains: list[list[int]], labels: list[int]
) -> tuple[Paths, Int[ndarray, " M"]]:
    """Join the tracklets of each chain to one path, by linear interpolation in the gaps.

    Args:
        tracklets: The tracklets, with M rows.
        chains: The tracklets of each chain, in the order of time.
        labels: Label of each chain.

    Returns:
        The paths, and the index of each of the M rows in these, -1 for tracklets in no chain.
    """
    dimension = tracklets.states.shape[1]
    steps, place = tracklets.steps, np.full(len(tracklets.states), -1, dtype=np.int64)
    firsts = [int(tracklets.firsts[chain[0]]) for chain in chains]
    lasts = [int(tracklets.lasts[chain[-1]]) for chain in chains]
    lengths = [last + 1 - first for first, last in zip(firsts, lasts, strict=True)]
    found = Paths.blank(labels, firsts, lengths, dimension)
    for path, chain in enumerate(chains):
        rows = np.concatenate(
            [np.arange(tracklets.starts[k], tracklets.starts[k + 1]) for k in chain]
        )
        own, within = steps[rows], found.rows_of(path)
        every = np.arange(own[0], own[-1] + 1)
        for axis in range(dimension):
            found.states[within, axis] = np.interp(every, own, tracklets.states[rows, axis])
        found.covariances[within] = np.eye(dimension)
        place[rows] = within.start + own - own[0]
        found.covariances[place[rows]] = tracklets.covariances[rows]
    return found, place
