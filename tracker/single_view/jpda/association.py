"""The association matrix of one step: probabilities of all pairs of target and measurement.

[FBS83] Fortmann, Bar-Shalom, Scheffe, "Sonar tracking of multiple targets using joint
probabilistic data association", IEEE Journal of Oceanic Engineering 8(3), 1983.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.special import gammaln

from tracker.filters import association
from tracker.filters.association import MOST_ITEMS, Marginals
from tracker.filters.gaussian_mixture import gate_distance
from tracker.parameters.groups.jpda import JpdaParams
from tracker.single_view.jpda.targets import Innovations


def associate(
    found: Innovations,
    possible: Bool[ndarray, "n M"],
    area: float,
    parameters: JpdaParams,
) -> tuple[Float[ndarray, "n M"], Int[ndarray, " n"]]:
    """Compute association probabilities β_tj, and the likeliest joint event.

    By Bayes' rule a joint event has the weight Π_t P_D Λ_tj or 1 − P_D P_G, times

    * **poisson**: λ_c / area for each false measurement;
    * **diffuse**, as published: Φ! / V^Φ, for an unknown number Φ. V is the area of the ellipse
      that is a gate with P_G, π γ √|S| ([FBS83]_); so that it is one number for all gates, it is
      in units of √|S|, as is then Λ.

    Groups of targets that share no measurement are independent.

    Args:
        found: Innovations of all targets and measurements.
        possible: Whether each measurement is in the gate of each target.
        area: Area of the image, square pixels.
        parameters: P_D, P_G, the kind of joint events, and the model of Φ.

    Returns:
        β_tj, and the measurement of each target in the likeliest joint event, -1 for none.
    """
    p = parameters
    targets, count = possible.shape
    matrix = np.zeros((targets, count))
    own = np.full(targets, -1, dtype=np.int64)
    densities, clutter = found.densities, p.clutter_rate / area
    if p.clutter == "diffuse":
        densities = densities * np.sqrt(np.linalg.det(found.covariances))
        clutter = 1.0 / (np.pi * gate_distance(p.gate_probability, 2))
    detected = np.where(possible, p.detection_probability * densities, 0.0)
    # a density may underflow to 0 inside its gate; the pair remains possible
    detected[possible] = np.maximum(detected[possible], np.finfo(float).tiny)
    miss = 1.0 - p.detection_probability * p.gate_probability
    for members, shared in association.clusters(possible):
        if not len(shared):
            continue
        part = np.ix_(members, shared)
        weights = (np.full(len(members), miss), detected[part], np.full(len(shared), clutter))
        matrix[part] = _marginals(*weights, p).detected
        sources = association.murty(*weights, 1).sources[0]
        own[members[sources[sources >= 0]]] = shared[sources >= 0]
    return matrix, own


def _marginals(
    missed: Float[ndarray, " n"],
    detected: Float[ndarray, "n M"],
    unexplained: Float[ndarray, " M"],
    p: JpdaParams,
) -> Marginals:
    """Compute the association probabilities by the chosen method.

    Args:
        missed: Factor of the joint probability if a target has no measurement.
        detected: Factor of the joint probability of each pair of a target and a measurement.
        unexplained: Factor of the joint probability if a measurement is false.
        p: The parameters.
    """
    count = len(unexplained)
    false_counts = np.exp(gammaln(np.arange(count + 1) + 1.0)) if p.clutter == "diffuse" else None
    if p.association == "exact":
        if min(detected.shape) <= MOST_ITEMS:
            return association.exact_marginals(
                missed, detected, unexplained, false_counts=false_counts
            )
        return association.marginals(missed, detected, unexplained)
    if p.association == "murty":
        events = association.murty(missed, detected, unexplained, p.events)
    else:
        events = association.simplified_murty(missed, detected, unexplained)
    weights = association.log_weights(
        events, missed, detected, unexplained, false_counts=false_counts
    )
    return association.marginals_of(events, weights)
