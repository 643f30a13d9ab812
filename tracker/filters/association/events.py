"""Lists of joint events: the K best, or K that share no pair, and their marginals.

The weights w_i0, w_ij and ρ_j of n targets and M measurements are defined in
:mod:`tracker.filters.association`.

[WW10] Wang, Wan, patent CN101783020A, 2010.
[FBS83] Fortmann, Bar-Shalom, Scheffe, "Sonar tracking of multiple targets using joint
probabilistic data association", IEEE Journal of Oceanic Engineering 8(3), 1983.
[M68] K. G. Murty, "An algorithm for ranking all the assignments in order of increasing
cost", Operations Research 16(3), 1968.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.filters.association.belief_propagation import Marginals
from tracker.kernels.association.disjoint import disjoint_matchings
from tracker.kernels.association.matchings import best_matchings


@dataclass(frozen=True, slots=True, eq=False)
class JointEvents:
    """K joint events of n targets and M measurements."""

    sources: Int[ndarray, "K M"]
    """The target of each measurement, -1 for none."""
    targets: int
    """n, the number of targets."""

    @property
    def size(self) -> int:
        """K, the number of events."""
        return len(self.sources)

    @property
    def target_indicators(self) -> Bool[ndarray, "K n"]:
        """δ_t: whether target t has a measurement."""
        present = np.zeros((self.size, self.targets + 1), dtype=bool)
        present[np.arange(self.size)[:, None], self.sources] = True  # source -1 is the last column
        return np.asarray(present[:, : self.targets])

    @property
    def false_counts(self) -> Int[ndarray, " K"]:
        """Φ: the number of measurements without a target."""
        return np.asarray((self.sources < 0).sum(axis=1))


def simplified_murty(
    missed: Float[ndarray, " n"],
    detected: Float[ndarray, "n M"],
    unexplained: Float[ndarray, " M"],
    count: int | None = None,
) -> JointEvents:
    """Up to K joint events, each the best that shares no pair with those before ([WW10]_).

    Targets and measurements are the two sides of a weighted graph, the smaller side padded
    with dummies; a pair weighs

        ln(1 + w_ij / (w_i0 ρ_j))

    which is about the log odds of the pair where these are large, and always above 0. The
    heaviest matching, by the Hungarian method, is one event: a target that is matched to a
    dummy is missed, and a measurement that is matched to one is clutter. The pairs of that
    matching are removed from the graph, and the next matching is that of the remaining graph.
    Exact Murty would split the rest into n parts and search each.

    K = n + M events are enough for every pair to occur. In a heaviest matching at least one end of
    every pair that is not chosen is matched to another partner. So while a pair (i, j) remains,
    each matching removes another pair of i or of j, of which there are n + M − 2. The last event
    has no pair at all. Since each pair occurs in one event only, an association that is likely in
    many joint events counts once: the more targets compete, the less exact are the marginals.

    Args:
        missed: w_i0 > 0, the weight of target i being missed.
        detected: w_ij, the weight of target i having made measurement j; 0 outside the gate.
        unexplained: ρ_j > 0, clutter and newborn intensity at measurement j.
        count: K, the largest number of events, at least 1; n + M if None.

    Returns:
        At least one event; all differ, in the order of their matchings.
    """
    targets, measurements = detected.shape
    size = max(targets, measurements)
    weights = np.zeros((size, size))
    weights[:targets, :measurements] = np.log1p(detected / missed[:, None] / unexplained)
    most = max(1, targets + measurements) if count is None else count
    columns = disjoint_matchings(weights, most)
    columns[columns < 0] = measurements
    return JointEvents(_sources(columns, targets, measurements), targets)


def murty(
    missed: Float[ndarray, " n"],
    detected: Float[ndarray, "n M"],
    unexplained: Float[ndarray, " M"],
    count: int,
) -> JointEvents:
    """The K joint events of the greatest weight Π w_i0 Π w_ij Π ρ_j, greatest first.

    They are ranked by Murty's partition [M68] of a square assignment problem, in which target i may
    also be assigned to a dummy with the weight w_i0, and measurement j to one with the weight ρ_j.

    Args:
        missed: w_i0 > 0, the weight of target i being missed.
        detected: w_ij, the weight of target i having made measurement j; 0 outside the gate.
        unexplained: ρ_j > 0, clutter and newborn intensity at measurement j.
        count: K, the number of events; fewer are returned where fewer exist.
    """
    targets, measurements = detected.shape
    size = targets + measurements
    if size == 0:
        return JointEvents(np.zeros((1, 0), dtype=np.int64), 0)
    cost = np.full((size, size), np.inf)  # rows: targets, dummies; columns: measurements, dummies
    with np.errstate(divide="ignore"):
        cost[:targets, :measurements] = -np.log(detected)
        np.fill_diagonal(cost[:targets, measurements:], -np.log(missed))
        np.fill_diagonal(cost[targets:, :measurements], -np.log(unexplained))
    cost[targets:, measurements:] = 0.0
    columns = best_matchings(cost, targets, count)
    return JointEvents(_sources(columns, targets, measurements), targets)


def log_weights(
    events: JointEvents,
    missed: Float[ndarray, " n"],
    detected: Float[ndarray, "n M"],
    unexplained: Float[ndarray, " M"],
    *,
    false_counts: Float[ndarray, " M1"] | None = None,
) -> Float[ndarray, " K"]:
    """Compute ln w(θ) of each event, -inf for one of weight 0.

    With w_i0 = 1 − P_D, w_ij = P_D Λ_ij, ρ_j = 1/V and g(Φ) = Φ! this is the numerator of
    Bayes' rule for a number of false measurements of which nothing is known ([FBS83]_,
    as in [WW10]_):

        P(θ | Z) ∝ Φ! / V^Φ · Π_j Λ_j^τ_j · Π_t P_D^δ_t (1 − P_D)^(1 − δ_t)

    Args:
        events: K events.
        missed: w_i0, the weight of target i being missed.
        detected: w_ij, the weight of target i having made measurement j; 0 outside the gate.
        unexplained: ρ_j, clutter and newborn intensity at measurement j.
        false_counts: g(0) … g(M), the factor by the number of measurements without a target; None
            for 1, which is that of a Poisson number of false measurements.
    """
    indices = np.arange(events.sources.shape[1])
    with np.errstate(divide="ignore"):
        # the last row is that of measurements without a target: source -1
        pairs = np.log(np.vstack([detected, unexplained]))
        total = pairs[events.sources, indices].sum(axis=1)
        total += np.where(events.target_indicators, 0.0, np.log(missed)).sum(axis=1)
        if false_counts is not None:
            total += np.log(np.asarray(false_counts, dtype=float))[events.false_counts]
    return np.asarray(total)


def marginals_of(events: JointEvents, log_weight: Float[ndarray, " K"]) -> Marginals:
    """Compute marginals over listed events alone: β_jt = Σ_θ P(θ) [t ← j].

    Args:
        events: K events of n targets and M measurements.
        log_weight: ln w(θ) of each event, up to a constant; at least one is finite.
    """
    probabilities = np.exp(log_weight - log_weight.max())
    probabilities /= probabilities.sum()
    measurements = events.sources.shape[1]
    rows = np.zeros((events.targets + 1, measurements))
    columns = np.broadcast_to(np.arange(measurements), events.sources.shape)
    np.add.at(rows, (events.sources, columns), probabilities[:, None])  # source -1 is the last row
    return Marginals(
        detected=rows[:-1],
        missed=probabilities @ ~events.target_indicators,
        unexplained=rows[-1],
    )


def _sources(columns: Int[ndarray, "K N"], targets: int, measurements: int) -> Int[ndarray, "K M"]:
    """The target of each measurement, -1 for none, from the column assigned to each row."""
    sources = np.full((len(columns), measurements + 1), -1, dtype=np.int64)
    assigned = np.minimum(columns[:, :targets], measurements)
    sources[np.arange(len(columns))[:, None], assigned] = np.arange(targets)
    return np.ascontiguousarray(sources[:, :measurements])
