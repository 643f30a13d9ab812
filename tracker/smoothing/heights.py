"""The height of each person, from the upper edges of the boxes over the whole track."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.smoothing.noise import COMMON, NoiseModel
from tracker.smoothing.paths import Paths

_HIGHEST = 0.9
"""Quantile of the rows' heights near which a person stands: it needs a tenth of the track."""

_BELOW = 3.0
"""Standard deviations of a row below that quantile from which the person does not stand."""

_NORMAL = 1.4826
"""Ratio of a normal distribution's standard deviation and its median absolute deviation."""


@dataclass(frozen=True, slots=True, eq=False)
class BoxTops:
    """Where the upper edges of L boxes are, above the world's origin."""

    rows: Int[ndarray, " L"]
    """Row of the paths of each box."""
    tops: Float[ndarray, " L"]
    """z of the upper end of the person's axis, metres."""
    variances: Float[ndarray, " L"]
    """Variance of it, square metres."""


def standing_heights(
    paths: Paths,
    seen: BoxTops,
    noise: NoiseModel,
    offsets: Float[ndarray, " C"],
    *,
    half_height: float,
    floor: float,
    step_time: float,
) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"]]:
    """Estimate the height of each person while standing, and its standard deviation.

    The tops of a row's boxes are averaged with the inverse of their variances to one height t_k.
    A person stands where t_k is at most three standard deviations below the highest tenth of all
    rows; the height is the median over these K rows. With their variance S², of which the share
    f = q²/(r² + q²) persists for a time τ, it has the variance

        S² ((1 − f)/K + f min(1, 2τ/(K Δt))) + κ (q² + b²) h²

    where r, q and τ are those of the upper edges; the last term, with the mean square b² of the
    differences between cameras and κ as for positions, is of errors that all boxes have in common.

    Args:
        paths: n paths.
        seen: The upper edges of their boxes.
        noise: The noise of the boxes.
        offsets: b, the offset of each camera's upper edges from the mean of all, half heights.
        half_height: h, of the target, metres.
        floor: z of the floor, metres.
        step_time: Δt, seconds.

    Returns:
        Metres above the floor; both NaN for a path without boxes.
    """
    rows, people = len(paths.states), len(paths.labels)
    weights = np.bincount(seen.rows, 1.0 / seen.variances, rows)
    total = np.bincount(seen.rows, seen.tops / seen.variances, rows)
    white, persistent = noise.white[1] ** 2, noise.persistent[1] ** 2
    share = persistent / (white + persistent)
    common = COMMON * (persistent + np.mean(offsets**2)) * half_height**2
    heights, sigmas = np.full(people, np.nan), np.full(people, np.nan)
    for person in range(people):
        own = paths.rows_of(person)
        there = weights[own] > 0.0
        if not there.any():
            continue
        tops = total[own][there] / weights[own][there]
        deviation = float(np.sqrt(np.median(1.0 / weights[own][there])))
        standing = tops[tops >= np.quantile(tops, _HIGHEST) - _BELOW * deviation]
        heights[person] = np.median(standing) - floor
        spread = max(_NORMAL * np.median(np.abs(standing - np.median(standing))), deviation)
        lasting = min(1.0, 2.0 * noise.time / (len(standing) * step_time))
        alike = (1.0 - share) / len(standing) + share * lasting
        sigmas[person] = np.sqrt(spread**2 * alike + common)
    return heights, sigmas
