"""What speaks for one person: whether a piece is somebody, and whether two are one."""

from __future__ import annotations

from collections.abc import Sequence as Many

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.fusion import visibility
from tracker.kernels.smoothing import evidence
from tracker.parameters import SmoothingParams
from tracker.smoothing.identity import pieces
from tracker.smoothing.identity.appearance import Appearance
from tracker.smoothing.identity.ends import Ends
from tracker.smoothing.identity.pieces import Pairs, chained, same_label
from tracker.smoothing.lifetimes import independence, misses
from tracker.smoothing.paths import Links, Paths
from tracker.smoothing.smoother import Fitted, Shared, Smoother

FASTEST = 3.0
"""Metres a second that nobody in a room exceeds for long."""


def of_pieces(
    smoother: Smoother, fitted: Fitted, shared: Shared, parameters: SmoothingParams
) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"], Float[ndarray, " n"]]:
    """Of each piece: the log odds of its boxes against clutter, of its birth and of its death."""
    step_time, paths = smoother.model.step_time, fitted.paths
    count = len(paths.labels)
    survival, death = _survival(smoother)
    rows = fitted.odds + independence(step_time, parameters.memory) * misses(shared) + survival
    worths = np.bincount(paths.owners, rows, count) + smoother.log_place
    births = np.where(paths.firsts <= 0, 0.0, anew(smoother) - death)
    deaths = np.where(paths.lasts >= smoother.frames - 1, 0.0, death)
    return worths, births, deaths


def _survival(smoother: Smoother) -> tuple[float, float]:
    """log p_S and log(1 − p_S)."""
    survival = min(smoother.parameters.survival_probability, 1.0 - 1e-6)
    return float(np.log(survival)), float(np.log1p(-survival))


def anew(smoother: Smoother) -> float:
    """log of the probability that somebody comes at a step, and of that somebody leaves at it."""
    rate = smoother.parameters.birth_rate * smoother.model.step_time
    return float(np.log(rate)) + _survival(smoother)[1]


class GoesOn:
    """Every pair of pieces of which the second may continue the first, with its gain: by their
    motion over a short gap, and their looks. The label that the filter gave both says nothing
    more: it came of the same boxes.

    Only the motion depends on what is known of the pieces' ends: the rest is looked into once.
    """

    def __init__(
        self,
        smoother: Smoother,
        paths: Paths,
        links: Links,
        p: SmoothingParams,
        looks: Many[Float[ndarray, "B A"]] | None,
    ) -> None:
        """Look into all that does not depend on the ends."""
        self._smoother, self._paths = smoother, paths
        self._share = independence(smoother.model.step_time, p.memory)
        self._near = near = pieces.near_pairs(
            paths,
            longest=max(round(p.longest / smoother.model.step_time), 1),
            fastest=FASTEST * smoother.model.step_time,
        )
        self._empty = _seen_empty(smoother, paths, near, p.memory)
        self._alike = np.zeros(len(near.earlier))
        if looks is not None:
            alike = Appearance(paths, links, smoother.cameras, looks, smoother.model.step_time)
            self._alike = p.appearance * alike.log_ratio(near.earlier, near.later)[0]

    def by(self, known: Ends) -> Pairs:
        """The pairs, by what is known of the pieces' ends."""
        smoother, near = self._smoother, self._near
        motion = pieces.motion_gains(
            self._paths,
            near,
            known.told_by(self._share),
            smoother.model.motion,
            smoother.prior,
            smoother.log_place,
        )
        survival, _ = _survival(smoother)
        gains = np.full((len(self._paths.labels),) * 2, -np.inf)
        gains[near.earlier, near.later] = motion + near.gaps * survival + self._empty + self._alike
        return _of_table(gains, self._paths)


def comes_back(
    smoother: Smoother,
    paths: Paths,
    links: Links,
    chains: list[list[int]],
    p: SmoothingParams,
    looks: Many[Float[ndarray, "B A"]] | None,
) -> Pairs:
    """Every pair of chains of which the second may be the first, gone for a while and back: one of
    those who left, by the looks, and by the label that the filter gave pieces of both."""
    whole, rows = chained(paths, chains, list(range(len(chains))))
    newcomer = anew(smoother)
    before = whole.lasts[:, None] < whole.firsts[None, :]
    gains = np.full(before.shape, -np.inf)
    if looks is not None:
        own = pieces.moved_to(links, rows)
        alike = Appearance(whole, own, smoother.cameras, looks, smoother.model.step_time)
        gone = np.maximum(before.sum(axis=0), 1)
        earlier, later = np.nonzero(before)
        ratio, known = alike.log_ratio(earlier, later)
        earlier, later, ratio = earlier[known], later[known], ratio[known]
        gains[earlier, later] = newcomer - np.log(gone[later]) + p.appearance * ratio
    chain_of = {piece: number for number, chain in enumerate(chains) for piece in chain}
    for one, other in same_label(paths):
        i, j = chain_of.get(one, -1), chain_of.get(other, -1)
        if min(i, j) >= 0 and before[i, j]:
            gains[i, j] = max(gains[i, j], newcomer) + p.keeping
    return _of_table(gains, whole)


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
