"""Forward and backward over whole paths, compiled: Kalman filter and Rauch-Tung-Striebel pass.

[RTS65] Rauch, Tung, Striebel, "Maximum likelihood estimates of linear dynamic systems",
AIAA Journal 3(8), 1965.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tracker.kernels.compilation import kernel


class PathMotion(NamedTuple):
    """How a person moves, and what is known of him at first."""

    transition: ndarray
    """F (d, d)."""
    noise: ndarray
    """Q (d, d)."""
    prior: ndarray
    """(d, d), covariance of a first state."""


class SmoothedRows(NamedTuple):
    """N rows of paths after both passes."""

    means: ndarray
    """(N, d)."""
    covariances: ndarray
    """(N, d, d)."""
    fits: ndarray
    """(N,), log ∫ N(p; m, P) L(p) dp of each row, by the boxes of the rows before."""
    traces: ndarray
    """(N,), of the position's covariance by the rows before and this one."""
    jumps: ndarray
    """(N,), squared Mahalanobis distance between what the rows before and those from this one on
    say."""


@kernel
def smooth_paths(
    starts: ndarray,
    begins: ndarray,
    information: ndarray,
    vectors: ndarray,
    motion: PathMotion,
) -> SmoothedRows:
    """The states of paths given all their boxes ([RTS65]), and how well these fit.

    A row's boxes say of its position p what log L(p) = yᵀp − ½ pᵀ Y p says, whatever their
    number: with the predicted N(m, P) the filter takes them as

        P⁺ = P − P_p (I + Y P_pp)⁻¹ Y P_pᵀ,   m⁺ = m + P⁺_p (y − Y m_p)

    which needs no inverse of Y: one camera alone may say nothing of depth.

    Args:
        starts: (n + 1,), where each path's rows begin, and the end.
        begins: (n, d), mean of each path's first state.
        information: Y (N, 3, 3), one a row.
        vectors: y (N, 3).
        motion: Of all.
    """
    transition, noise, prior = motion
    rows, d = len(information), len(transition)
    means, covariances = np.empty((rows, d)), np.empty((rows, d, d))
    ahead, ahead_covariances = np.empty((rows, d)), np.empty((rows, d, d))
    fits, traces, jumps = np.zeros(rows), np.empty(rows), np.zeros(rows)
    identity = np.eye(3)
    for path in range(len(starts) - 1):
        first, last = starts[path], starts[path + 1]
        for k in range(first, last):
            if k == first:
                m, p = begins[path].copy(), prior.copy()
            else:
                m = transition @ means[k - 1]
                p = transition @ covariances[k - 1] @ transition.T + noise
            ahead[k], ahead_covariances[k] = m, p
            y, v = information[k], vectors[k]
            if y[0, 0] + y[1, 1] + y[2, 2] > 0.0:
                here, side = m[:3].copy(), p[:, :3].copy()
                bracket = identity + y @ side[:3]
                inverse = np.linalg.inv(bracket)
                p = p - side @ (inverse @ y) @ side.T
                p = (p + p.T) / 2.0
                told = v - y @ here
                shift = p[:, :3].copy() @ told
                # log ∫ N(x; m, P) exp(yᵀx − ½ xᵀYx) dx, by the matrix determinant lemma
                fits[k] = (
                    here @ v
                    - 0.5 * here @ (y @ here)
                    + 0.5 * told @ shift[:3]
                    - 0.5 * math.log(max(np.linalg.det(bracket), 1e-300))
                )
                m = m + shift
            means[k], covariances[k] = m, p
            traces[k] = p[0, 0] + p[1, 1] + p[2, 2]
        for k in range(last - 2, first - 1, -1):
            gain = np.linalg.solve(ahead_covariances[k + 1], transition @ covariances[k]).T
            offset = means[k + 1] - ahead[k + 1]
            lost = ahead_covariances[k + 1] - covariances[k + 1]
            # what is learnt from behind is P⁻ (P⁻ − P)⁻¹ P⁻, where anything is
            ridge = 1e-9 * np.trace(ahead_covariances[k + 1]) / d
            jumps[k + 1] = max(offset @ np.linalg.solve(lost + ridge * np.eye(d), offset), 0.0)
            means[k] = means[k] + gain @ offset
            p = covariances[k] - gain @ lost @ gain.T
            covariances[k] = (p + p.T) / 2.0
    return SmoothedRows(means, covariances, fits, traces, jumps)
