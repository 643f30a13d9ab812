"""Particles over boxes: weights from colours, resampling, clusters, drawing anew.

Boxes are ``centre_x, centre_y, half_width, half_height`` in pixels.

[SG08] Sun, Guo, "Multiple object tracking with a pseudo particle filter", 2008.
[CM02] Comaniciu, Meer, "Mean shift: a robust approach toward feature space analysis",
IEEE TPAMI 24(5), 2002.
[GSS93] Gordon, Salmond, Smith, "Novel approach to nonlinear/non-Gaussian Bayesian state
estimation", IEE Proceedings F 140(2), 1993.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.kernels import particles

ITERATIONS = 30
"""Steps after which a climb ends; most converge well before."""

TOLERANCE = 0.01
"""A climb ends when a step is shorter than this many half sizes: far below any mode's deviation."""


def log_likelihoods(distances: Float[ndarray, "S G"], sharpness: float) -> Float[ndarray, " S"]:
    """max_g -λ d_g: the logarithm of a particle's weight exp(-λ d), the best over G targets.

    Args:
        distances: d of each particle to the colours of each target, 0 … 1; G ≥ 1.
        sharpness: λ.
    """
    return np.asarray((-sharpness * distances).max(axis=1))


def normalised(logarithms: Float[ndarray, " S"]) -> Float[ndarray, " S"]:
    """Weights that sum to 1, from their logarithms, however small; none for none."""
    if not len(logarithms):
        return np.zeros(0)
    weights = np.exp(logarithms - logarithms.max())
    return np.asarray(weights / weights.sum())


def normalised_by_group(
    logarithms: Float[ndarray, " S"], groups: Int[ndarray, " S"]
) -> Float[ndarray, " S"]:
    """Weights that sum to 1, each group's to its share of the particles.

    A target that fits its colours a little worse than another loses no particles to it.

    Args:
        logarithms: Of the weights, however small.
        groups: 0, 1, …, whom each particle belongs to.
    """
    if not len(logarithms):
        return np.zeros(0)
    largest = np.full(groups.max() + 1, -np.inf)
    np.maximum.at(largest, groups, logarithms)
    weights = np.exp(logarithms - largest[groups])
    sums, members = np.bincount(groups, weights), np.bincount(groups)
    return np.asarray(weights / sums[groups] * members[groups] / len(logarithms))


def effective_number(weights: Float[ndarray, " S"]) -> float:
    """1 / Σ w²: how many particles of equal weight would tell as much; 0 for none."""
    squared = float((weights**2).sum())
    return 1.0 / squared if squared > 0.0 else 0.0


def resample(
    weights: Float[ndarray, " S"], count: int, rng: np.random.Generator
) -> Int[ndarray, " S"]:
    """How often each particle is drawn in ``count`` multinomial draws ([GSS93]).

    Args:
        weights: Summing to 1; none gives none.
        count: Draws, ≥ 0.
        rng: Of the draws.
    """
    if not len(weights):
        return np.zeros(0, dtype=np.int64)
    return np.asarray(rng.multinomial(count, weights))


@dataclass(frozen=True, slots=True, eq=False)
class Clusters:
    """The modes of a set of particles, the largest cluster first."""

    modes: Float[ndarray, "M 4"]
    """Fixed points of the mean shift."""
    shares: Float[ndarray, " M"]
    """Of all particles, those that climb to each."""
    owners: Int[ndarray, " S"]
    """The mode that each particle climbs to; -1 for those of count 0."""


def clusters(
    boxes: Float[ndarray, "S 4"],
    counts: Int[ndarray, " S"],
    groups: Int[ndarray, " S"],
    *,
    bandwidth: float,
    merge_distance: float,
) -> Clusters:
    """Mean-shift clusters with the Epanechnikov kernel ([CM02], [SG08]).

    Every particle climbs to a fixed point of

        m ← Σ_i c_i [r_i < 1] x_i / Σ_i c_i [r_i < 1],  r_i = |(x_i - m) / (h H_m)|

    with the half sizes H_m of the box it stands at: the bandwidth follows the target's radius.

    Args:
        boxes: Particles, each once.
        counts: How often each was drawn.
        groups: Each group's particles have modes of their own; all the same for one group.
        bandwidth: h, in half sizes.
        merge_distance: Fixed points nearer than this, in half sizes, are one mode: the densest.

    Returns:
        No modes for no particles.
    """
    weights = np.ascontiguousarray(counts, dtype=float)
    climbed = particles.epanechnikov_climb(
        np.ascontiguousarray(boxes, dtype=float), weights, groups, bandwidth, ITERATIONS, TOLERANCE
    )
    order = np.argsort(-climbed.densities, kind="stable")
    modes = particles.join_modes(climbed.points, weights, order, merge_distance)
    owners, leaders = modes.owners, modes.leaders
    there = owners >= 0
    sums = np.bincount(owners[there], weights[there], minlength=len(leaders))
    by_size = np.argsort(-sums, kind="stable")
    ranks = np.empty(len(leaders) + 1, dtype=np.int64)
    ranks[by_size], ranks[-1] = np.arange(len(leaders)), -1
    shares = sums[by_size] / max(sums.sum(), 1.0)
    return Clusters(climbed.points[leaders[by_size]], shares, ranks[owners])


def redistribute(
    boxes: Float[ndarray, "T 4"],
    sigmas: Float[ndarray, "T 2"],
    count: int,
    rng: np.random.Generator,
) -> Float[ndarray, "S 4"]:
    """Draw particles anew around targets, the same number around each ([SG08]).

    Resampling leaves copies of a few particles (impoverishment), most of them on the
    target that fits best; these are Gaussian around every target.

    Args:
        boxes: Of the targets; none gives none.
        sigmas: Standard deviations of the centre, pixels.
        count: Particles of all targets together, shared out as evenly as it goes.
        rng: Of the draws.
    """
    if not len(boxes) or count == 0:
        return np.zeros((0, 4))
    target = np.arange(count) % len(boxes)
    drawn = boxes[target].copy()
    drawn[:, :2] += sigmas[target] * rng.standard_normal((count, 2))
    return drawn
