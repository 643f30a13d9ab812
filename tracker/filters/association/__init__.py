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

[WW10] Wang, Wan, "Fast tracking of multiple targets in video by joint probabilistic
data association", patent CN101783020A, 2010.
"""

from __future__ import annotations

from tracker.filters.association.belief_propagation import (
    CONVERGENCE,
    ITERATIONS,
    TOLERANCE,
    Marginals,
    marginals,
)
from tracker.filters.association.clustering import clusters
from tracker.filters.association.events import (
    JointEvents,
    log_weights,
    marginals_of,
    murty,
    simplified_murty,
)
from tracker.filters.association.exact import MOST_ITEMS, exact_marginals

__all__ = [
    "CONVERGENCE",
    "ITERATIONS",
    "MOST_ITEMS",
    "TOLERANCE",
    "JointEvents",
    "Marginals",
    "clusters",
    "exact_marginals",
    "log_weights",
    "marginals",
    "marginals_of",
    "murty",
    "simplified_murty",
]
