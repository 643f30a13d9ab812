"""Assignment of the particles' modes to targets: the hypothesis matrix and its best assignment.

[SG08] Sun, Guo, "Multiple object tracking with a pseudo particle filter", 2008.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.special import logsumexp

from tracker.geometry.assignment import linear_sum_assignment
from tracker.single_view.pseudo_particle.track_management import Targets


def vacancies(targets: Targets, persons: int, per_person: int) -> Int[ndarray, " A"]:
    """List the persons of possible new targets, each once for every further target of that person.

    Args:
        targets: The present targets.
        persons: Number of persons with templates.
        per_person: Largest number of targets with the colours of one person.
    """
    used = np.bincount(targets.persons, minlength=persons)
    return np.repeat(np.arange(persons), np.maximum(per_person - used, 0))


def hypothesis_matrix(
    modes: Float[ndarray, "M 4"],
    distances: Float[ndarray, "M G"],
    evidence: Float[ndarray, " M"],
    expected: Targets,
    vacant: Int[ndarray, " A"],
    *,
    sharpness: float,
    background_distance: float,
    position_sigma: float,
    position_gate: float,
) -> Float[ndarray, "M columns"]:
    """Compute log likelihoods of each mode as a target, a new target, or background ([SG08]).

        h(m, t) = ε_m exp(-λ d(m, t)) exp(-½ |(x_m - x_t) / (σ_a H_t)|²)   of T targets
        h(m, a) = ε_m exp(-λ d(m, a)) exp(-½ k_a²)                        of A new targets
        h(m, 0) = exp(-λ d_0) exp(-½ k_a²)                                of the background

    The places of new targets and of the background are unknown; they count as k_a standard
    deviations off, so that a tracked target may have less similar colours than they.

    Args:
        modes: Boxes of M modes, pixels.
        distances: d of each mode to the colours of each of G persons.
        evidence: ln ε_m, other log likelihood ratios of each mode being a person.
        expected: The predicted targets.
        vacant: Person of each possible new target.
        sharpness: λ, the decrease of the log likelihood for each unit of distance.
        background_distance: d_0, the distance that the background is given, 0 … 1.
        position_sigma: σ_a, in half sizes H_t of a target.
        position_gate: k_a, in σ_a, at which an unknown place is as likely as a target.

    Returns:
        T + A + 1 columns; the background is the last.
    """
    colours = evidence[:, None] - sharpness * distances
    apart = modes[:, None, :2] - expected.boxes[None, :, :2]
    apart = apart / (position_sigma * np.maximum(expected.boxes[None, :, 2:], 0.5))
    unknown = -0.5 * position_gate**2
    return np.concatenate(
        [
            colours[:, expected.persons] - 0.5 * (apart**2).sum(axis=2),
            colours[:, vacant] + unknown,
            np.full((len(modes), 1), unknown - sharpness * background_distance),
        ],
        axis=1,
    )


def best_hypothesis(matrix: Float[ndarray, "M columns"]) -> Int[ndarray, " M"]:
    """Find the column of each mode in the likeliest assignment.

    The background may have any number of modes, every other column one at most, and the sum of
    the logarithms is the largest possible.
    """
    count, columns = matrix.shape
    background = np.repeat(matrix[:, -1:], count, axis=1)
    rows, chosen = linear_sum_assignment(
        np.concatenate([matrix[:, :-1], background], axis=1), maximize=True
    )
    best = np.full(count, columns - 1)
    best[rows] = np.minimum(chosen, columns - 1)
    return best


def apart(
    modes: Float[ndarray, "M 4"],
    existences: Float[ndarray, " M"],
    columns: Int[ndarray, " M"],
    known: int,
    background: int,
    separation: float,
) -> Int[ndarray, " M"]:
    """Assign new targets too near to another target to the background instead.

    Args:
        modes: Boxes of the modes, pixels.
        existences: Existence probability of each; the larger of two new targets remains.
        columns: Column of each mode in the hypothesis matrix.
        known: Number of columns that are targets.
        background: The column of the background.
        separation: Least distance, in half sizes of the target that is there.
    """
    result = np.where(columns < known, columns, background)
    for mode in np.argsort(-existences, kind="stable"):
        if not known <= columns[mode] < background:
            continue
        there = modes[result < background]
        offsets = (there[:, :2] - modes[mode, :2]) / there[:, 2:]
        if np.all((offsets**2).sum(axis=1) >= separation**2):
            result[mode] = columns[mode]
    return result


def target_probabilities(matrix: Float[ndarray, "M columns"]) -> Float[ndarray, " M"]:
    """Compute the probability that each mode is a target: 1 − h(m, 0) / Σ h(m, ·)."""
    if not len(matrix):
        return np.zeros(0)
    return np.asarray(-np.expm1(matrix[:, -1] - logsumexp(matrix, axis=1)))
