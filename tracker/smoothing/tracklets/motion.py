"""Motion between tracklets: estimates at their ends, log odds of links, and identity swaps.

Identity swaps are steps at which two paths fit the motion better with their tails exchanged.
"""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.filters.models import Motion
from tracker.smoothing.paths import Paths, same_label
from tracker.smoothing.smoother import Fitted
from tracker.steps.table import Table

PRIOR_LEFT = 1e-9
"""Share of the prior's information that is not subtracted from that of the estimates, so that
rounding leaves boxes without information about 0 and not less."""

SLACK = 1.0
"""Distance beyond what a person can walk within which two tracks are compared, metres: estimates at
the ends of tracks err. Halved, it changes mean recall and IDF1 by at most 0.0004; doubled, IDF1 in
crowds by 0.005, one exchange."""

_CHANGES = 0.1
"""Probability that a person's process noise returns to the model's within a gap: who stood may walk
on. From 0.02 to 0.4 no figure of four random crowds and four recordings changes."""


@dataclass(frozen=True, slots=True, eq=False)
class Ends:
    """The ends of n tracklets, in the units of the state: metres and seconds."""

    ends: Float[ndarray, "n d"]
    """The last state of each tracklet, filtered from the boxes up to it."""
    covariances: Float[ndarray, "n d d"]
    """The covariance of each last state."""
    information: Float[ndarray, "n d d"]
    """Information matrix Λ on the first state of each tracklet, of the boxes from it on."""
    vectors: Float[ndarray, "n d"]
    """Information vector η of the same."""
    noise_scales: Float[ndarray, "n 2"]
    """Factor s on the process noise at the first and at the last state."""

    @staticmethod
    def alone(fitted: Fitted, prior: Float[ndarray, "d d"]) -> Ends:
        """Estimate the ends from the boxes of each tracklet alone.

        Args:
            fitted: The tracklets, each fitted to its own boxes.
            prior: Prior covariance of a first state in the fit.
        """
        tracklets = fitted.paths
        ends, begins = tracklets.starts[1:] - 1, tracklets.starts[:-1]
        inverse, origin = np.linalg.inv(tracklets.covariances[begins]), np.linalg.inv(prior)
        centre = tracklets.states[begins].copy()
        centre[:, 3:] = 0.0
        return Ends(
            tracklets.states[ends],
            tracklets.covariances[ends],
            inverse - origin,
            np.einsum("pij,pj->pi", inverse, tracklets.states[begins]) - centre @ origin,
            np.stack([fitted.noise_scales[begins], fitted.noise_scales[ends]], axis=1),
        )

    def discounted(self, share: float) -> Ends:
        """Discount the information of the boxes to a share, since errors of boxes are correlated.

        Args:
            share: Share of the information that is independent, 0 … 1.
        """
        return replace(
            self,
            covariances=self.covariances / share,
            information=self.information * share,
            vectors=self.vectors * share,
        )

    def in_chains(
        self, tracklets: Paths, chains: Fitted, rows: Int[ndarray, " M"], motion: Motion
    ) -> Ends:
        """Estimate the ends from all boxes of the chains that the tracklets are in.

        A tracklet of one step has no information about velocity; the tracklets before and after
        it have. The filtered state of a row is obtained from the prediction of the next row by
        inverting one step of the motion,

            m = F⁻¹ m⁻,   P = F⁻¹ (P⁻ − s Q) F⁻ᵀ

        Args:
            tracklets: The tracklets, with M rows.
            chains: The chains, fitted to their boxes.
            rows: The row of the chains for each of the M rows; -1 for tracklets in no chain, whose
                ends do not change.
            motion: The motion model of both.
        """
        firsts, lasts = rows[tracklets.starts[:-1]], rows[tracklets.starts[1:] - 1]
        joined = np.flatnonzero(firsts >= 0)
        first, last, paths = firsts[joined], lasts[joined], chains.paths
        ends, covariances = self.ends.copy(), self.covariances.copy()
        ends[joined], covariances[joined] = paths.states[last], paths.covariances[last]
        goes_on = ~np.isin(last, paths.starts[1:] - 1)
        after, back = last[goes_on] + 1, np.linalg.inv(motion.transition)
        added = chains.noise_scales[after, None, None] * motion.noise
        ends[joined[goes_on]] = chains.ahead[after] @ back.T
        covariances[joined[goes_on]] = back @ (chains.ahead_covariances[after] - added) @ back.T
        inverse = np.linalg.inv(paths.covariances[first])
        before = (1.0 - PRIOR_LEFT) * np.linalg.inv(chains.ahead_covariances[first])
        information, vectors = self.information.copy(), self.vectors.copy()
        information[joined] = inverse - before
        vectors[joined] = np.einsum("pij,pj->pi", inverse, paths.states[first])
        vectors[joined] -= np.einsum("pij,pj->pi", before, chains.ahead[first])
        noise_scales = self.noise_scales.copy()
        noise_scales[joined, 0] = chains.noise_scales[first]
        noise_scales[joined, 1] = chains.noise_scales[last]
        return Ends(ends, covariances, information, vectors, noise_scales)


@dataclass(frozen=True, slots=True, eq=False)
class Pairs(Table):
    """P pairs of tracklets that may be linked, the first before the second."""

    earlier: Int[ndarray, " P"]
    """Index of the first tracklet."""
    later: Int[ndarray, " P"]
    """Index of the second tracklet."""
    gaps: Int[ndarray, " P"]
    """Number of steps from the end of the first to the beginning of the second, at least 1."""
    gains: Float[ndarray, " P"]
    """Log odds of the second continuing the first against being a new target."""

    def of_ends(self, chains: Many[Many[int]]) -> Pairs:
        """Convert pairs of chains to pairs of one's last tracklet and the other's first."""
        first = np.array([chain[0] for chain in chains], dtype=np.int64)
        last = np.array([chain[-1] for chain in chains], dtype=np.int64)
        return Pairs(last[self.earlier], first[self.later], self.gaps, self.gains)


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
    near = np.linalg.norm(way, axis=1) <= SLACK + fastest * gaps
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
    """Compute log ∫ N(x; m, P) e^{ηᵀx − ½ xᵀΛx} dx for P Gaussians and information pairs.

    Args:
        means: m of each Gaussian, metres and metres per second.
        covariances: P of each Gaussian.
        information: Λ, an information matrix for each; it may be singular.
        vectors: η, an information vector for each.
    """
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


def exchange_breaks(
    fitted: Fitted, *, reach: float, least: float, apart: int
) -> Bool[ndarray, " N"]:
    """Find the rows before which two paths are split, so that each may continue as the other.

    Where a filter swapped two tracks as they passed, its association was not ambiguous at any
    row: only both paths as a whole show it.

    Args:
        fitted: The paths, fitted to their boxes.
        reach: Distance on the ground within which two paths are compared, metres.
        least: Log odds of the swap above which both are split; the linking decides about it.
        apart: Number of steps within which the same two paths are split once, where the odds are
            largest.
    """
    paths = fitted.paths
    breaks = np.zeros(len(paths.states), dtype=bool)
    one, other = _pairs(fitted, reach)
    if not len(one):
        return breaks
    gains = exchange_log_odds(fitted, one, other)
    for chosen in _best_of_encounters(
        paths.owners[one], paths.owners[other], paths.steps[one], gains, apart
    ):
        if gains[chosen] > least:
            breaks[[one[chosen], other[chosen]]] = True
    return breaks


def exchange_log_odds(
    fitted: Fitted, one: Int[ndarray, " P"], other: Int[ndarray, " P"]
) -> Float[ndarray, " P"]:
    """Compute the log odds of a swap at pairs of rows of one step.

    With N(a_i, A_i) the prediction of path i to step k from the rows before, and Λ_i, η_i the
    information of its rows from k on, the swap of the paths i and j at k gains

        g = ℓ(a_i, A_i; η_j, Λ_j) + ℓ(a_j, A_j; η_i, Λ_i) − ℓ(a_i, A_i; η_i, Λ_i)
            − ℓ(a_j, A_j; η_j, Λ_j),    ℓ = log ∫ N(x; a, A) e^{ηᵀx − ½ xᵀΛx} dx

    Args:
        fitted: The paths, fitted to their boxes.
        one: Index of the row of path i, of each of P pairs.
        other: Index of the row of path j, at the same step.
    """
    paths = fitted.paths
    rows, place = np.unique(np.concatenate([one, other]), return_inverse=True)
    i, j = place[: len(one)], place[len(one) :]
    a, spread = fitted.ahead[rows], fitted.ahead_covariances[rows]
    inverse, before = np.linalg.inv(paths.covariances[rows]), np.linalg.inv(spread)
    information = inverse - (1.0 - PRIOR_LEFT) * before
    vectors = np.einsum("nij,nj->ni", inverse, paths.states[rows])
    vectors -= (1.0 - PRIOR_LEFT) * np.einsum("nij,nj->ni", before, a)
    own = log_integral(a, spread, information, vectors)
    gains = log_integral(a[i], spread[i], information[j], vectors[j])
    gains += log_integral(a[j], spread[j], information[i], vectors[i])
    return np.asarray(gains - own[i] - own[j])


def find_exchange(fitted: Fitted, one: int, other: int, after: int, until: int) -> list[int]:
    """Find the rows before which two paths are split so that the one continues as the other.

    They are those of the step at which the swap has the largest log odds.

    Args:
        fitted: The paths, fitted to their boxes.
        one: Index of the first path.
        other: Index of the path that it continues as.
        after: A step at which the person is still on the first path.
        until: A step at which the person is on the other.

    Returns:
        A row of each path; none where the first path ends before the other begins.
    """
    paths = fitted.paths
    first = max(after + 1, int(paths.firsts[one]) + 1, int(paths.firsts[other]))
    last = min(until, int(paths.lasts[one]), int(paths.lasts[other]))
    if last < first:
        return []  # the paths do not overlap in time
    steps = np.arange(first, last + 1)
    own = int(paths.starts[one]) + steps - int(paths.firsts[one])
    others = int(paths.starts[other]) + steps - int(paths.firsts[other])
    best = int(np.argmax(exchange_log_odds(fitted, own, others)))
    return [int(own[best]), int(others[best])]


def _pairs(fitted: Fitted, reach: float) -> tuple[Int[ndarray, " P"], Int[ndarray, " P"]]:
    """The pairs of rows of two paths at one step that are near each other, without first rows."""
    paths = fitted.paths
    inner = np.ones(len(paths.states), dtype=bool)
    inner[paths.starts[:-1]] = False
    rows = np.flatnonzero(inner)
    rows = rows[np.argsort(paths.steps[rows], kind="stable")]
    steps = paths.steps[rows]
    last = np.searchsorted(steps, steps, side="right")
    count = last - np.arange(len(rows)) - 1
    one = np.repeat(np.arange(len(rows)), count)
    offset = np.arange(len(one)) - np.repeat(np.cumsum(count) - count, count)
    one, other = rows[one], rows[one + 1 + offset] if len(one) else one
    way = fitted.ahead[one, :2] - fitted.ahead[other, :2]
    near = (way**2).sum(axis=1) <= reach**2
    return one[near], other[near]


def _best_of_encounters(
    one: Int[ndarray, " P"],
    other: Int[ndarray, " P"],
    steps: Int[ndarray, " P"],
    gains: Float[ndarray, " P"],
    apart: int,
) -> list[int]:
    """The pair of rows of the largest gain for each encounter of two paths.

    Args:
        one: Path of the first row of each pair.
        other: Path of the second row.
        steps: Step of each pair.
        gains: Log odds of a swap at each pair.
        apart: Number of steps without a pair after which two paths meet anew.
    """
    order = np.lexsort((steps, np.maximum(one, other), np.minimum(one, other)))
    low, high = np.minimum(one, other)[order], np.maximum(one, other)[order]
    fresh = np.ones(len(order), dtype=bool)
    fresh[1:] = (np.diff(low) != 0) | (np.diff(high) != 0) | (np.diff(steps[order]) > max(apart, 1))
    meeting = np.cumsum(fresh) - 1
    by_gain = np.lexsort((-gains[order], meeting))
    first = np.ones(len(order), dtype=bool)
    first[1:] = np.diff(meeting[by_gain]) != 0
    return [int(k) for k in order[by_gain[first]]]
