"""Costs of the tracklet association, as log odds: of each tracklet, and of each possible link."""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.fusion import target_model
from tracker.kernels.smoothing import evidence
from tracker.parameters.groups.smoothing import SmoothingParams
from tracker.smoothing.lifetimes import independent_share, log_miss_likelihoods
from tracker.smoothing.paths import Links, Paths, join_chains, renumber_rows, same_label
from tracker.smoothing.smoother import BoxAssociations, Fitted, Smoother
from tracker.smoothing.tracklets.appearance import AppearanceModel
from tracker.smoothing.tracklets.motion import Ends, Pairs, motion_gains, near_pairs

FASTEST = 3.0
"""Largest speed of a person in a room over several steps, metres per second. Halved, it changes
mean recall and IDF1 by at most 0.001; doubled, IDF1 in crowds by 0.005, one exchange."""

KEEPING = 2.0
"""Log odds that the filter's label adds to a link over a longer gap. From 0 to 8, no figure of the
random rooms, random crowds and recordings of ``tests/papers/rooms/fusion_ablations.md`` changes."""

_LEAST = 1e-6
"""Least probability that a person leaves, or that none comes."""

_POINTS = 4096
"""Number of points on the lines between tracklets whose expected boxes are in memory at a time."""


@dataclass(frozen=True, slots=True)
class Rates:
    """How often people come and leave, as the recording's own tracks show it."""

    birth: float
    """Expected number of people who come in one step, below 1."""
    death: float
    """Probability that a person has left a step later."""

    @staticmethod
    def of(smoother: Smoother, paths: Paths, present: Bool[ndarray, " n"]) -> Rates:
        """Estimate the rates from tracks, with the parameters of the fusion as the prior.

        A rate γ of births has the prior density γ₀⁻¹ e^(−γ/γ₀), whose mean is the parameter γ₀,
        and a probability of death the beta density with mean 1 − p_S that is worth one death. With
        b tracks that begin after the first of T steps, and d that end before the last, over N rows,
        the means given the tracks are

            γ = (b + 1) / (T + 1/γ₀),    1 − p = (d + 1) / (N + 1/(1 − p_S))

        Args:
            smoother: The parameters, and the number of steps.
            paths: n tracks.
            present: Which of them are of people.
        """
        p, frames = smoother.parameters, smoother.frames
        births = int((present & (paths.firsts > 0)).sum())
        deaths = int((present & (paths.lasts < frames - 1)).sum())
        rows = int(np.diff(paths.starts)[present].sum())
        leaving = max(1.0 - p.survival_probability, _LEAST)
        birth = (births + 1) / (frames + 1.0 / (p.birth_rate * smoother.model.step_time))
        return Rates(min(birth, 1.0 - _LEAST), (deaths + 1) / (rows + 1.0 / leaving))

    @property
    def survival(self) -> float:
        """Log probability that a person is still there a step later."""
        return float(np.log1p(-self.death))

    @property
    def leave(self) -> float:
        """Log probability that a person has left a step later."""
        return float(np.log(self.death))

    @property
    def restart(self) -> float:
        """Log probability of a death and a birth at one step, which compete with a link."""
        return float(np.log(self.birth)) + self.leave


def tracklet_odds(
    smoother: Smoother,
    fitted: Fitted,
    shared: BoxAssociations,
    parameters: SmoothingParams,
    rates: Rates,
) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"], Float[ndarray, " n"]]:
    """Compute the log odds of each tracklet against clutter, and log probabilities of birth and
    death.

    Args:
        smoother: The models and the boxes.
        fitted: The n tracklets, fitted to their boxes.
        shared: Association and miss probabilities of their rows.
        parameters: Time constant of correlated evidence.
        rates: How often people come and leave.

    Returns:
        Log odds of being a target, log probability of a birth at the first step, and of a death
        after the last; the last two are 0 at the ends of the recording.
    """
    step_time, paths = smoother.model.step_time, fitted.paths
    count = len(paths.labels)
    rows = fitted.odds + independent_share(step_time, parameters.memory) * log_miss_likelihoods(
        shared
    )
    rows += rates.survival
    worths = np.bincount(paths.owners, rows, count) + smoother.log_place
    births = np.where(paths.firsts <= 0, 0.0, rates.restart - rates.leave)
    deaths = np.where(paths.lasts >= smoother.frames - 1, 0.0, rates.leave)
    return worths, births, deaths


class ShortGapOdds:
    """Log odds of links over short gaps, from motion, appearance and misses in the gap.

    The filter's labels are not used: they came from the same boxes. Only the odds of the motion
    depend on the estimates at the tracklets' ends; the rest is computed once.
    """

    def __init__(
        self,
        smoother: Smoother,
        paths: Paths,
        links: Links,
        p: SmoothingParams,
        embeddings: Many[Float[ndarray, "B A"]] | None,
        rates: Rates,
    ) -> None:
        """Compute the odds that do not depend on the estimates at the ends.

        Args:
            smoother: The models and the boxes.
            paths: The n tracklets.
            links: Association probabilities of their rows and boxes.
            p: The longest gap, and the weight of the appearance.
            embeddings: A unit vector for each box of each camera; None without appearance.
            rates: How often people come and leave.
        """
        self._smoother, self._paths, self._rates = smoother, paths, rates
        self._share = independent_share(smoother.model.step_time, p.memory)
        self._near = near = near_pairs(
            paths,
            longest=max(round(p.longest / smoother.model.step_time), 1),
            fastest=FASTEST * smoother.model.step_time,
        )
        self._empty = _seen_empty(smoother, paths, near, p.memory)
        self._alike = np.zeros(len(near.earlier))
        if embeddings is not None:
            alike = AppearanceModel(
                paths, links, smoother.cameras, embeddings, smoother.model.step_time
            )
            self._alike = p.appearance * alike.log_ratio(near.earlier, near.later)[0]

    def pairs(self, known: Ends) -> Pairs:
        """Return the possible pairs with their log odds, given the estimates at the tracklets'
        ends."""
        smoother, near = self._smoother, self._near
        motion = motion_gains(
            self._paths,
            near,
            known.discounted(self._share),
            smoother.model.motion,
            smoother.prior,
            smoother.log_place,
        )
        gains = motion + near.gaps * self._rates.survival + self._empty + self._alike
        paths = self._paths
        return _finite(near.earlier, near.later, gains, paths.firsts, paths.lasts)


def long_gap_odds(
    smoother: Smoother,
    paths: Paths,
    links: Links,
    chains: list[list[int]],
    p: SmoothingParams,
    embeddings: Many[Float[ndarray, "B A"]] | None,
    rates: Rates,
) -> Pairs:
    """Compute the log odds of links over long gaps, from appearance and from the filter's labels.

    The prior probabilities that the later chain continues each of the chains that ended before it,
    and that it is of a new person, are equal.

    Args:
        smoother: The models and the boxes.
        paths: The n tracklets.
        links: Association probabilities of their rows and boxes.
        chains: The tracklets of each chain.
        p: Weight of the appearance.
        embeddings: A unit vector for each box of each camera; None without appearance.
        rates: How often people come and leave.

    Returns:
        Pairs of chains with their log odds.
    """
    newcomer, count = rates.restart, len(chains)
    keys, gains = np.zeros(0, dtype=np.int64), np.zeros(0)
    firsts = np.array([paths.firsts[chain[0]] for chain in chains], dtype=np.int64)
    lasts = np.array([paths.lasts[chain[-1]] for chain in chains], dtype=np.int64)
    if embeddings is not None:
        whole, rows = join_chains(paths, chains, list(range(len(chains))))
        own = renumber_rows(links, rows)
        alike = AppearanceModel(whole, own, smoother.cameras, embeddings, smoother.model.step_time)
        before = lasts[:, None] < firsts[None, :]
        gone = np.maximum(before.sum(axis=0), 1)
        earlier, later = np.nonzero(before)
        ratio, known = alike.log_ratio(earlier, later)
        earlier, later, ratio = earlier[known], later[known], ratio[known]
        keys = earlier * count + later
        gains = newcomer - np.log(gone[later]) + p.appearance * ratio
    chain_of = {tracklet: number for number, chain in enumerate(chains) for tracklet in chain}
    kept: dict[int, float] = {}
    for one, other in same_label(paths):
        i, j = chain_of.get(one, -1), chain_of.get(other, -1)
        if min(i, j) >= 0 and lasts[i] < firsts[j]:
            key = i * count + j
            place = int(np.searchsorted(keys, key))
            there = place < len(keys) and keys[place] == key
            gain = kept.get(key, float(gains[place]) if there else -np.inf)
            kept[key] = max(gain, newcomer) + KEEPING
    # of two gains of one pair the first
    keys, first = np.unique(
        np.concatenate([np.array(list(kept), dtype=np.int64), keys]), return_index=True
    )
    gains = np.concatenate([np.array(list(kept.values())), gains])[first]
    return _finite(keys // max(count, 1), keys % max(count, 1), gains, firsts, lasts)


def _finite(
    earlier: Int[ndarray, " P"],
    later: Int[ndarray, " P"],
    gains: Float[ndarray, " P"],
    firsts: Int[ndarray, " n"],
    lasts: Int[ndarray, " n"],
) -> Pairs:
    """List the pairs with finite gains, ordered by the first and then the second."""
    order = np.lexsort((later, earlier))
    order = order[np.isfinite(gains[order])]
    earlier, later = earlier[order], later[order]
    return Pairs(earlier, later, firsts[later] - lasts[earlier], gains[order])


def _seen_empty(
    smoother: Smoother, paths: Paths, pairs: Pairs, memory: float
) -> Float[ndarray, " P"]:
    """Compute the log likelihood of the cameras' misses in the gap of each pair, at most 0.

    The person is assumed to move on a straight line. A camera that views a point of the line and
    has no box there counts as a miss; one with a box there, of the person or of an occluder, has no
    effect.
    """
    inner = pairs.gaps - 1
    total = np.zeros(len(inner))
    # so many pairs at a time that their points are about as many
    part = np.cumsum(inner) // _POINTS
    for own in np.split(np.arange(len(inner)), np.flatnonzero(np.diff(part)) + 1):
        total[own] = _seen_empty_at(smoother, paths, pairs.take(own))
    return total * independent_share(smoother.model.step_time, memory)


def _seen_empty_at(smoother: Smoother, paths: Paths, pairs: Pairs) -> Float[ndarray, " P"]:
    """Sum of :func:`_seen_empty` of some pairs, as if all misses were independent."""
    inner = pairs.gaps - 1
    total = np.zeros(len(inner))
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
        expected = model.target.expected(model.cameras[c], states)
        chances = p.detection_probability * target_model.inside_probability(
            model.cameras[c], expected, spread, soft=p.edge == "soft"
        )
        chances = np.where(camera.blind[steps], 0.0, chances)
        against = evidence.seen_empty(
            expected.boxes, expected.valid, chances, steps, camera.starts, camera.boxes
        )
        total += np.bincount(pair, against, len(inner))
    return total
