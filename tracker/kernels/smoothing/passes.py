"""Forward and backward over whole paths, compiled: smoothing, and existence.

The smoother is a Kalman filter and a Rauch-Tung-Striebel pass [RTS65].

[RTS65] Rauch, Tung, Striebel, "Maximum likelihood estimates of linear dynamic systems",
AIAA Journal 3(8), 1965.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tracker.kernels.compilation import kernel
from tracker.kernels.linear_algebra import factorise, solve


class PathMotion(NamedTuple):
    """The motion model of a path, and the prior of its first state."""

    transition: ndarray
    """F (d, d), transition matrix of one step."""
    noise: ndarray
    """Q (d, d), process noise of one step."""
    prior: ndarray
    """(d, d), prior covariance of a first state."""


class SmoothedRows(NamedTuple):
    """N rows of paths after both passes."""

    means: ndarray
    """(N, d), smoothed states."""
    covariances: ndarray
    """(N, d, d), smoothed covariances."""
    fits: ndarray
    """(N,), log ∫ N(p; m, P) L(p) dp of each row, with the prediction from the rows before."""
    traces: ndarray
    """(N,), trace of the position's filtered covariance, square metres."""
    ahead: ndarray
    """m⁻ (N, d), prediction of each row from the rows before."""
    ahead_covariances: ndarray
    """P⁻ (N, d, d), covariances of these predictions."""


class _Workspace(NamedTuple):
    """Working memory for one row."""

    inverse: ndarray
    """(3, 3)."""
    system: ndarray
    """(3, 3), S."""
    side: ndarray
    """(d, 3), W."""
    half: ndarray
    """(d, d)."""
    lower: ndarray
    """(d, d)."""


@kernel
def _carry(
    mean: ndarray,
    covariance: ndarray,
    motion: PathMotion,
    noise_scales: float,
    half: ndarray,
    ahead: ndarray,
    ahead_covariance: ndarray,
) -> None:
    """Compute m⁻ = F m and P⁻ = F P Fᵀ + s Q, into the last two; F P remains in ``half``."""
    transition, d = motion.transition, len(mean)
    for a in range(d):
        ahead[a] = 0.0
        for b in range(d):
            half[a, b] = 0.0
        for r in range(d):
            if transition[a, r] != 0.0:  # most entries are 0
                ahead[a] += transition[a, r] * mean[r]
                for b in range(d):
                    half[a, b] += transition[a, r] * covariance[r, b]
    for a in range(d):
        for b in range(a + 1):
            total = noise_scales * motion.noise[a, b]
            for r in range(d):
                total += half[a, r] * transition[b, r]
            ahead_covariance[a, b] = total
            ahead_covariance[b, a] = total


@kernel
def _inverse(matrix: ndarray, inverse: ndarray) -> float:
    """Invert a 3 × 3 matrix by its cofactors, in place; returns its determinant."""
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        for p in range(3):
            q, r = (p + 1) % 3, (p + 2) % 3
            inverse[p, a] = matrix[b, q] * matrix[c, r] - matrix[b, r] * matrix[c, q]
    determinant = 0.0
    for p in range(3):
        determinant += matrix[0, p] * inverse[p, 0]
    for a in range(3):
        for p in range(3):
            inverse[p, a] /= determinant
    return determinant


@kernel
def _update(
    y: ndarray, v: ndarray, mean: ndarray, covariance: ndarray, workspace: _Workspace
) -> float:
    """Update mean and covariance by the information of a row's boxes, in place.

    With P_pp = L Lᵀ, W = P_p L⁻ᵀ and S = I + Lᵀ Y L it is P⁺ = P − W (I − S⁻¹) Wᵀ: S is symmetric
    and at least I, however large Y and P are, so that P⁺ has no cancellation.

    Returns:
        log ∫ N(x; m, P) exp(vᵀx − ½ xᵀYx) dx, by the matrix determinant lemma.
    """
    inverse, system, side, half, lower = workspace
    d = len(mean)
    factorise(covariance[:3, :3], lower[:3, :3])
    for a in range(d):
        for b in range(3):
            total = covariance[a, b]
            for r in range(b):
                total -= side[a, r] * lower[b, r]
            side[a, b] = total / lower[b, b]
    for a in range(3):
        for b in range(3):
            half[a, b] = 0.0
            for r in range(b, 3):
                half[a, b] += y[a, r] * lower[r, b]
    for a in range(3):
        for b in range(a + 1):
            total = 1.0 if a == b else 0.0
            for r in range(a, 3):
                total += lower[r, a] * half[r, b]
            system[a, b] = total
            system[b, a] = total
    determinant = _inverse(system, inverse)
    for a in range(d):
        for b in range(3):
            half[a, b] = side[a, b]
            for r in range(3):
                half[a, b] -= side[a, r] * inverse[r, b]
    for a in range(d):
        for b in range(a + 1):
            total = covariance[a, b]
            for r in range(3):
                total -= half[a, r] * side[b, r]
            covariance[a, b] = total
            covariance[b, a] = total
    fixed, found = 0.0, 0.0
    for a in range(3):
        system[0, a] = v[a]
        fixed += mean[a] * v[a]
        for b in range(3):
            system[0, a] -= y[a, b] * mean[b]
            fixed -= 0.5 * mean[a] * y[a, b] * mean[b]
    for a in range(3):
        for b in range(3):
            found += 0.5 * system[0, a] * covariance[a, b] * system[0, b]
    for a in range(d):
        for b in range(3):
            mean[a] += covariance[a, b] * system[0, b]
    return fixed + found - 0.5 * math.log(max(determinant, 1e-300))


@kernel
def _look_back(
    mean: ndarray,
    covariance: ndarray,
    later: ndarray,
    later_covariance: ndarray,
    ahead: ndarray,
    ahead_covariance: ndarray,
    transition: ndarray,
    workspace: _Workspace,
) -> None:
    """Smooth mean and covariance of a row by those of the row after it ([RTS65]), in place.

    G = P Fᵀ (P⁻)⁻¹,   m += G (m_after − m⁻),   P += G (P_after − P⁻) Gᵀ
    """
    half, lower, d = workspace.half, workspace.lower, len(mean)
    factorise(ahead_covariance, lower)
    gain = np.empty((d, d))
    crossing = np.empty(d)
    for a in range(d):
        for b in range(d):
            crossing[b] = 0.0
            for r in range(d):
                if transition[b, r] != 0.0:
                    crossing[b] += transition[b, r] * covariance[r, a]
        solve(lower, crossing, gain[a])
    for a in range(d):
        for b in range(d):
            mean[a] += gain[a, b] * (later[b] - ahead[b])
            half[a, b] = 0.0
            for r in range(d):
                half[a, b] += gain[a, r] * (later_covariance[r, b] - ahead_covariance[r, b])
    for a in range(d):
        for b in range(a + 1):
            total = covariance[a, b]
            for r in range(d):
                total += half[a, r] * gain[b, r]
            covariance[a, b] = total
            covariance[b, a] = total


@kernel
def smooth_paths(
    starts: ndarray,
    begins: ndarray,
    information: ndarray,
    vectors: ndarray,
    motion: PathMotion,
    noise_scales: ndarray,
) -> SmoothedRows:
    """Estimate the states of paths given all their boxes ([RTS65]), and the likelihood of these.

    The boxes of a row have the log likelihood log L(p) = yᵀp − ½ pᵀ Y p of its position p, whatever
    their number: with the prediction N(m, P) the filter updates by

        P⁺ = P − P_p (I + Y P_pp)⁻¹ Y P_pᵀ,   m⁺ = m + P⁺_p (y − Y m_p)

    which needs no inverse of Y: one camera alone may have no information about depth.

    Args:
        starts: (n + 1,), index of each path's first row, and N.
        begins: (n, d), prior mean of each path's first state.
        information: Y (N, 3, 3), information matrix of each row.
        vectors: y (N, 3), information vector of each row.
        motion: The motion model of all paths.
        noise_scales: s (N,), factor on Q for the step to each row.
    """
    rows, d = len(information), len(motion.transition)
    means, covariances = np.empty((rows, d)), np.empty((rows, d, d))
    ahead, ahead_covariances = np.empty((rows, d)), np.empty((rows, d, d))
    fits, traces = np.zeros(rows), np.empty(rows)
    workspace = _Workspace(
        np.empty((3, 3)), np.empty((3, 3)), np.empty((d, 3)), np.empty((d, d)), np.zeros((d, d))
    )
    for path in range(len(starts) - 1):
        first, last = starts[path], starts[path + 1]
        for k in range(first, last):
            if k == first:
                ahead[k], ahead_covariances[k] = begins[path], motion.prior
            else:
                _carry(
                    means[k - 1], covariances[k - 1], motion, noise_scales[k], workspace.half,
                    ahead[k], ahead_covariances[k],
                )  # fmt: skip
            means[k], covariances[k] = ahead[k], ahead_covariances[k]
            y = information[k]
            if y[0, 0] + y[1, 1] + y[2, 2] > 0.0:
                fits[k] = _update(y, vectors[k], means[k], covariances[k], workspace)
            traces[k] = covariances[k, 0, 0] + covariances[k, 1, 1] + covariances[k, 2, 2]
        for k in range(last - 2, first - 1, -1):
            _look_back(
                means[k], covariances[k], means[k + 1], covariances[k + 1],
                ahead[k + 1], ahead_covariances[k + 1], motion.transition, workspace,
            )  # fmt: skip
    return SmoothedRows(means, covariances, fits, traces, ahead, ahead_covariances)


@kernel
def jumps(
    starts: ndarray,
    means: ndarray,
    covariances: ndarray,
    ahead: ndarray,
    ahead_covariances: ndarray,
) -> ndarray:
    """Compute how far the boxes before each row and those from it on contradict each other.

    The value is the squared Mahalanobis distance between the two estimates of the state.

    The covariances of the two estimates sum up to P⁻ (P⁻ − P)⁻¹ P⁻.

    Args:
        starts: (n + 1,), index of each path's first row, and N.
        means: m (N, d), smoothed states; these four arguments are fields of :class:`SmoothedRows`.
        covariances: P (N, d, d), smoothed covariances.
        ahead: m⁻ (N, d), prediction of each row from the rows before.
        ahead_covariances: P⁻ (N, d, d), covariances of these predictions.

    Returns:
        (N,), 0 at each path's first row.
    """
    found = np.zeros(len(means))
    for path in range(len(starts) - 1):
        for k in range(starts[path] + 1, starts[path + 1]):
            offset = means[k] - ahead[k]
            lost = ahead_covariances[k] - covariances[k]
            d = len(offset)
            ridge = 1e-9 * np.trace(ahead_covariances[k]) / d
            found[k] = max(offset @ np.linalg.solve(lost + ridge * np.eye(d), offset), 0.0)
    return found


@kernel
def drives(found: SmoothedRows, noise: ndarray, axes: ndarray) -> ndarray:
    """Compute the evidence of each row on the scale of its process noise, by some components.

        tr Q (λ λᵀ + P⁻⁻¹ P P⁻⁻¹ − P⁻⁻¹),   λ = P⁻⁻¹ (m − m⁻)

    It is above 0 where the state moves more than its process noise expects:
    :func:`tracker.smoothing.smoother.process_noise_scales` uses it.

    Args:
        found: The N smoothed rows.
        noise: Q (g, g), process noise of some components of the state.
        axes: (g,), indices of these components.
    """
    d, size = found.means.shape[1], len(axes)
    lower, columns = np.zeros((d, d)), np.empty((size, d))
    unit, pulled, pulls = np.zeros(d), np.empty(d), np.empty(size)
    drive = np.zeros(len(found.means))
    for k in range(len(drive)):
        factorise(found.ahead_covariances[k], lower)
        for g in range(size):
            unit[axes[g]] = 1.0
            solve(lower, unit, columns[g])
            unit[axes[g]] = 0.0
            pulls[g] = 0.0
            for a in range(d):
                pulls[g] += columns[g, a] * (found.means[k, a] - found.ahead[k, a])
        for g in range(size):
            for a in range(d):
                pulled[a] = 0.0
                for b in range(d):
                    pulled[a] += found.covariances[k, a, b] * columns[g, b]
            for h in range(size):
                term = pulls[g] * pulls[h] - columns[g, axes[h]]
                for a in range(d):
                    term += pulled[a] * columns[h, a]
                drive[k] += noise[g, h] * term
    return drive


@kernel
def sums_around(starts: ndarray, values: ndarray, kept: float) -> ndarray:
    """Compute Σ_j κ^{|j − k|} v_j of each row k over the rows j of its path.

    Args:
        starts: (n + 1,), index of each path's first row, and N.
        values: v (N,), one value for each row.
        kept: κ, 0 … 1, the factor per step.
    """
    before, after = values.copy(), values.copy()
    for path in range(len(starts) - 1):
        first, last = starts[path], starts[path + 1]
        for k in range(first + 1, last):
            before[k] += kept * before[k - 1]
        for k in range(last - 2, first - 1, -1):
            after[k] += kept * after[k + 1]
    total: ndarray = before + after - values
    return total


class ExistenceTransitions(NamedTuple):
    """The transition model of existence, as log probabilities."""

    stay: float
    """Log probability of existing at the next step."""
    enter: float
    """Log probability of a birth, and of a death."""
    change: float
    """Log probability of becoming absent for a while, and of returning."""


class Presence(NamedTuple):
    """The existence of n tracks over N rows."""

    probabilities: ndarray
    """(N,), 1 / (1 + e^−δ) at each row, with the log odds δ of the best sequence in which the track
    exists there against the best in which it does not."""
    odds: ndarray
    """(n,), log odds of the best sequence that exists at some step against never existing."""


@kernel
def presence(
    starts: ndarray, firsts: ndarray, votes: ndarray, transitions: ExistenceTransitions, end: int
) -> Presence:
    """Compare, for each path and step, the best sequences of presence with and without the step.

    A track is born once and dies once, with the probability e^enter each, and may be absent in
    between, with e^change for each change; staying present has e^stay, being absent has 1.
    Viterbi's recursion, forwards and backwards, gives the exact maximum over all sequences in
    which the track exists at a step, and over those in which it does not (max-marginals, no sums).

    Args:
        starts: (n + 1,), index of each path's first row, and N.
        firsts: (n,), first step of each path.
        votes: (N,), log likelihood ratio of each row's evidence: the track exists against it does
            not.
        transitions: The transition model of all paths.
        end: Last step of the recording: a track that exists at it has not died, and one that
            exists at step 0 was not born.
    """
    stay, enter, change = transitions
    chances = np.zeros(len(votes))
    odds = np.full(len(starts) - 1, -np.inf)
    for path in range(len(starts) - 1):
        first, count = starts[path], starts[path + 1] - starts[path]
        here, between, gone = np.empty(count), np.empty(count), np.empty(count)
        present, away, left = -np.inf, -np.inf, -np.inf
        coming = 0.0 if firsts[path] <= 0 else enter
        for k in range(count):
            away, left, present = (
                max(away, present + change),
                max(left, present + enter),
                max(coming, max(away + change, present + stay)) + votes[first + k],
            )
            here[k], between[k], gone[k] = present, away, left
            coming = enter
        leaving = 0.0 if firsts[path] + count - 1 >= end else enter
        odds[path] = max(present + leaving, left)
        # the best continuation from each state
        if_present, if_never, if_away = leaving, 0.0, -np.inf
        for k in range(count - 1, -1, -1):
            absent = max(if_never, max(between[k] + if_away, gone[k]))
            difference = absent - here[k] - if_present
            chances[first + k] = 1.0 / (1.0 + math.exp(min(max(difference, -500.0), 500.0)))
            on = votes[first + k] + if_present
            if_present, if_never, if_away = (
                max(stay + on, max(change + if_away, enter)),
                max(if_never, enter + on),
                max(if_away, change + on),
            )
    return Presence(chances, odds)
