"""The association of measurements with targets: joint events and marginal probabilities.

A joint event θ gives every target one measurement or none, and every measurement one
target or none. Its weight, of n targets and M measurements, is

    w(θ) = Π_{i missed} w_i0 · Π_{i ← j} w_ij · Π_{j unassigned} ρ_j · g(Φ)

with Φ the number of measurements without a target. All functions take these weights, as
densities or probabilities of any common scale:

* :func:`marginals`: all events, by belief propagation, approximately, for any size;
* :func:`exact_marginals`: all events, exactly, for clusters of a dozen or two;
* :func:`murty`: the K best events, exactly;
* :func:`simplified_murty`: events that share no pair, fast ([WW10]);
* :func:`marginals_of`: the marginals over a given list of events.

For exact marginals, the sum over all joint events has more terms than can be enumerated, but after
any number of measurements only the *set* of targets that are assigned matters, not which
measurement each has: M · 2ⁿ sums suffice (or n · 2ᴹ, whichever is less). Efficient hypothesis
management uses the same observation: S. Maskell, M. Briers, R. Wright, "Fast mutual exclusion",
Signal and Data Processing of Small Targets, SPIE 5428, 2004.

[WW10] Wang, Wan, "Fast tracking of multiple targets in video by joint probabilistic
data association", patent CN101783020A, 2010.
[WL14] J. L. Williams, R. Lau, "Approximate evaluation of marginal association
probabilities with belief propagation", IEEE Transactions on Aerospace and
Electronic Systems 50(4), 2014.
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

from tracker.kernels.association import (
    Convergence,
    belief_propagation,
    best_matchings,
    disjoint_matchings,
    subset_marginals,
)


def clusters(possible: Bool[ndarray, "n M"]) -> list[tuple[ndarray, ndarray]]:
    """Find groups of targets that share measurements; each can be associated independently.

    Args:
        possible: Whether target i may have made measurement j.

    Returns:
        Indices of the targets and of the measurements of each group, ascending. A target
        without any measurement is a group of its own; a measurement outside every gate is in
        no group.
    """
    targets = len(possible)
    left = np.ones(targets, dtype=bool)
    groups = []
    for first in range(targets):
        if not left[first]:
            continue
        members = np.zeros(targets, dtype=bool)
        members[first] = True
        while True:
            shared = possible[members].any(axis=0)
            wider = members | possible[:, shared].any(axis=1)
            if (wider == members).all():
                break
            members = wider
        left &= ~members
        groups.append((np.flatnonzero(members), np.flatnonzero(shared)))
    return groups


TOLERANCE = 1e-6
"""Default criterion of convergence: the largest |Δν_ji| ρ_j of an iteration. It is far below the
precision to which an association probability matters."""

ITERATIONS = 200
"""Default largest number of iterations, if the messages do not converge before."""

CONVERGENCE = Convergence(TOLERANCE, ITERATIONS)
"""Tolerance and number of iterations, in the form that the kernels take."""


@dataclass(frozen=True, slots=True, eq=False)
class Marginals:
    """Marginal association probabilities of n targets and M measurements."""

    detected: Float[ndarray, "n M"]
    """P(target i made measurement j)."""
    missed: Float[ndarray, " n"]
    """P(target i made no measurement); with :attr:`detected` a row sums to 1."""
    unexplained: Float[ndarray, " M"]
    """P(no target made measurement j): it is clutter or of a new target."""


def marginals(
    missed: Float[ndarray, " n"],
    detected: Float[ndarray, "n M"],
    unexplained: Float[ndarray, " M"],
    *,
    tolerance: float = TOLERANCE,
    iterations: int = ITERATIONS,
) -> Marginals:
    """Compute marginals of the one-to-one association by loopy belief propagation ([WL14]_).

        μ_ij = w_ij / (w_i0 + Σ_{j'≠j} w_ij' ν_j'i),  ν_ji = 1 / (ρ_j + Σ_{i'≠i} μ_i'j)
        P(i ← j) ∝ w_ij ν_ji,  P(i misses) ∝ w_i0,  P(j unexplained) = ρ_j / (ρ_j + Σ_i μ_ij)

    The messages converge to a unique fixed point ([WL14]_); on a graph without cycles the marginals
    are exact.

    Args:
        missed: w_i0 ≥ 0, the weight of target i being missed; 0 only if the target has a pair.
        detected: w_ij, the weight of target i having made measurement j; 0 outside the gate.
        unexplained: ρ_j, clutter and newborn intensity at measurement j, > 0.
        tolerance: Largest |Δν_ji| ρ_j at which the iteration stops.
        iterations: Largest number of iterations.
    """
    found = belief_propagation(
        np.ascontiguousarray(missed, dtype=float),
        np.ascontiguousarray(detected, dtype=float),
        np.ascontiguousarray(unexplained, dtype=float),
        Convergence(tolerance, iterations),
    )
    return Marginals(found.rows[:, 1:], found.rows[:, 0], found.unexplained)


MOST_ITEMS = 18
"""Largest value of min(n, M): the memory grows as n · 2ⁿ, 44 MB for n = M = 18 and 193 MB for
20."""


def exact_marginals(
    missed: Float[ndarray, " n"],
    detected: Float[ndarray, "n M"],
    unexplained: Float[ndarray, " M"],
    *,
    false_counts: Float[ndarray, " M1"] | None = None,
) -> Marginals:
    """Compute marginals of the one-to-one association over all joint events, up to rounding.

    Args:
        missed: w_i0, the weight of target i being missed.
        detected: w_ij, the weight of target i having made measurement j; 0 outside the gate.
        unexplained: ρ_j, clutter and newborn intensity at measurement j.
        false_counts: g(0) … g(M), the factor by the number of measurements without a target;
            None stands for 1.

    Returns:
        Marginals whose rows and columns sum to 1.

    Raises:
        ValueError: If both numbers are above :data:`MOST_ITEMS`, or no joint event has a
            positive weight.
    """
    targets, count = detected.shape
    if min(targets, count) > MOST_ITEMS:
        raise ValueError(
            f"exact marginals of {targets} targets and {count} measurements: one of the numbers "
            f"must be at most {MOST_ITEMS}; split them into clusters, or use belief propagation"
        )
    factors = np.ones(count + 1) if false_counts is None else np.asarray(false_counts, float)
    # by the number of targets that have a measurement: the other measurements are false
    factors = factors[::-1][: min(targets, count) + 1]
    factors = np.ascontiguousarray(factors / factors.max())
    weights = np.array(detected, dtype=float)
    missed, unexplained = np.array(missed, dtype=float), np.array(unexplained, dtype=float)
    # each measurement and each target has one factor in every event: scaled to at most 1,
    # measurements first, since their weights are densities of any unit
    columns = np.maximum(unexplained, weights.max(axis=0, initial=0.0))
    columns[columns == 0.0] = 1.0
    weights /= columns
    unexplained /= columns
    rows = np.maximum(missed, weights.max(axis=1, initial=0.0))
    rows[rows == 0.0] = 1.0
    weights /= rows[:, None]
    missed /= rows
    if targets <= count:
        # measurement by measurement, each of which is assigned a target or none
        sums = subset_marginals(unexplained, np.ascontiguousarray(weights.T), missed, factors)
        detected, none, left = sums.chosen.T, sums.left, sums.none
    else:
        sums = subset_marginals(missed, weights, unexplained, factors)
        detected, none, left = sums.chosen, sums.none, sums.left
    if not sums.total > 0.0:
        raise ValueError("no joint event has a positive weight; give every target a w_i0 above 0")
    return Marginals(detected / sums.total, none / sums.total, left / sums.total)


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
