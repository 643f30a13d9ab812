"""One label, one person: a constraint that the plain PHD recursion does not have.

The PHD takes people as Poisson: a camera's miss multiplies every weight by 1 − p_D
whatever the cameras before saw, one component may explain two boxes, and two labels
may share one person. Here a label stands for one person who is there with
probability r, the sum of its components' weights.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.filters import association
from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.filters.phd import PhdUpdate
from tracker.fusion.model import CONFIRMED
from tracker.kernels import linear_algebra
from tracker.kernels.labelled import marginals
from tracker.kernels.labelled.marginals import LabelledWeights, PairOdds

_LARGEST_ODDS = 600.0  # the logarithm of what still fits a float with room to spare


def share_boxes(
    predicted: GaussianMixture,
    updated: PhdUpdate,
    detection_probability: Float[ndarray, " J"],
    *,
    births: range,
    next_label: int,
) -> PhdUpdate:
    """Weigh the update anew: each person makes at most one box, each box at most one person.

    With o_l(z) = Σ_{j∈l} p_j w_j q_j(z) / κ the odds of label l for box z, the
    association probabilities P(l ← z) and P(l misses) are the marginals of the
    one-to-one association with weights 1 − Σ_{j∈l} p_j w_j for a miss and o_l(z) for a
    box, by belief propagation. Then

        w_j(z) = P(l ← z) p_j w_j q_j(z) / (κ o_l(z))
        w_j ← w_j (1 − p_j) P(l misses) / (1 − Σ_{i∈l} p_i w_i)

    For one person alone that is Bayes' rule for existence, r' = r(1 − p)/(1 − r p) on
    a miss, which asks for no order of the cameras. Births of this step stay Poisson:
    they compete with the clutter, and what a box makes of them gets a label of its own.

    Args:
        predicted: J components before this camera.
        updated: The plain update by its boxes.
        detection_probability: p_j.
        births: The labels of this step's births.
        next_label: The first label that is free.

    Returns:
        The update with these weights and labels.
    """
    size, boxes = predicted.size, len(updated.measurement_weights)
    owner, box = updated.parents[size:], updated.measurements[size:]
    shared = marginals.share_boxes(
        LabelledWeights(predicted.weights, predicted.labels, detection_probability),
        births.start,
        births.stop,
        PairOdds(owner, box, updated.log_odds, boxes),
        _LARGEST_ODDS,
        association.SETTLING,
    )
    labels = np.where(shared.of_people, predicted.labels[owner], next_label + box)
    posterior = GaussianMixture(
        np.concatenate([updated.posterior.weights[:size] * shared.factors, shared.shares]),
        updated.posterior.means,
        updated.posterior.covariances,
        np.concatenate([predicted.labels, labels]),
    )
    return PhdUpdate(
        posterior,
        updated.parents,
        updated.measurements,
        updated.log_odds,
        np.bincount(box, shared.shares, boxes),
    )


def owners(mixture: GaussianMixture) -> Int[ndarray, " J"]:
    """Who may be merged with whom: a sure person's components with nobody else's, -1 for others."""
    label = linear_algebra.group_labels(mixture.labels).places
    sure = np.bincount(label, mixture.weights) > CONFIRMED
    return np.asarray(np.where(sure[label], mixture.labels, -1))
