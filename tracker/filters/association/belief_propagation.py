"""The association of measurements with targets: marginal probabilities by belief propagation.

[WL14] J. L. Williams, R. Lau, "Approximate evaluation of marginal association
probabilities with belief propagation", IEEE Transactions on Aerospace and
Electronic Systems 50(4), 2014.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.kernels.association.belief_propagation import Convergence, belief_propagation

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
