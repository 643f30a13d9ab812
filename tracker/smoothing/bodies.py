"""The shape of people's bodies, from how boxes disagree between cameras, and their heights.

A box is predicted from the ends of a person's vertical axis, but a detector bounds the body: its
feet reach further down in the image on the camera's side, and the rim of its head further up, by
more the steeper the camera looks. For a cylinder of radius ρ an edge is further out by

    ρ |∂h/∂(x, y)|

to first order: the support function of a circle under the linearised projection. The part of it
that is the same at all places is taken for an offset of the camera or for the person's size; the
rest displaces the estimate of everybody who is not in the middle between the cameras, always by the
same amount at the same place.

Where the axis is inclined in the image, the horizontal centre depends on the level ω at which the
body is widest, half heights above its middle: it is off by ω (x_head − x_foot) / 2. Cameras agree
about that but for a small part, since another position explains it nearly as well. So positions are
not corrected by ω; its mean square is part of their uncertainty.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.smoothing.noise import COMMON, NoiseModel
from tracker.smoothing.paths import Paths

MOST_ROWS = 2000
"""Number of rows from which the shape is estimated. Halved, it changes the mean share of positions
within the reported ellipse of 95 % by 0.003; doubled, nothing."""

_LEVEL_SIGMA = 0.3
"""Prior standard deviation of ω: from the hips to the shoulders of an upright adult, which are at
0.53 and 0.82 of the height (Drillis, Contini, "Body segment parameters", 1966), it is 0.06 to
0.64, and a carried load or spread legs are lower. Halved or doubled, it changes that share by
0.0002 at most."""

_LEAST = 1e-3
"""Least standard deviation of an edge, half heights."""

_WEAK = 1e-6
"""Share of the trace of a position's information that is added to its diagonal, so that it has an
inverse where the boxes of a row tell nothing of a direction."""

_EDGES = 1, 2
"""The numbers of a measurement that are the upper and the lower edge."""


@dataclass(frozen=True, slots=True, eq=False)
class RowBoxes:
    """The boxes of K rows of paths in C cameras, with measurements of size m."""

    residuals: Float[ndarray, "K C m"]
    """Measurement less what is expected of the axis, half heights."""
    jacobians: Float[ndarray, "K C m 3"]
    """Derivative of the measurement by the position, half heights per metre."""
    edges: Float[ndarray, "K C 2"]
    """Derivative of upper and lower edge by the radius, half heights per metre."""
    levels: Float[ndarray, "K C"]
    """Derivative of the horizontal centre by ω."""
    there: Float[ndarray, "K C"]
    """1 where there is a box, else 0."""
    owners: Int[ndarray, " K"]
    """Path of each row."""

    @staticmethod
    def none(owners: Int[ndarray, " K"], cameras: int, size: int) -> RowBoxes:
        """Rows without boxes.

        Args:
            owners: Path of each of K rows.
            cameras: C, the number of cameras.
            size: m, the size of a measurement, 3 or 4.
        """
        shape = len(owners), cameras
        return RowBoxes(
            np.zeros((*shape, size)),
            np.zeros((*shape, size, 3)),
            np.zeros((*shape, len(_EDGES))),
            np.zeros(shape),
            np.zeros(shape),
            owners,
        )


class BodyPriors(NamedTuple):
    """The standard deviations of normal priors around 0."""

    radius: float
    """Of the radius, metres."""
    offset: float
    """Of the offset of a camera's edges, half heights."""
    size: float
    """Of a person's height, as a share of the target's."""


class BodyShape(NamedTuple):
    """The shape of bodies, and the changes of offsets and sizes that it replaces in part."""

    radius: float
    """ρ, metres, at least 0."""
    radius_sigma: float
    """Its standard deviation, metres."""
    level_sigma: float
    """Root of the mean square of ω, half heights."""
    offsets: Float[ndarray, "C m"]
    """Change of the cameras' offsets, half heights."""
    sizes: Float[ndarray, " n"]
    """Change of the people's sizes, as shares of the target's height."""


def estimate_bodies(
    seen: RowBoxes,
    upright: Float[ndarray, " m"],
    people: int,
    independent: float,
    priors: BodyPriors,
) -> BodyShape:
    """Estimate radius and level together with the cameras' offsets and the people's sizes.

    The position of every row is free, so that only what its cameras disagree about counts: with the
    inverse covariance W of the edges and their derivatives H by the position, parameters θ with
    the derivatives A have the information Aᵀ M A, M = W − W H (Hᵀ W H)⁻¹ Hᵀ W.

    Args:
        seen: The boxes.
        upright: Change of a measurement with the person's size, half heights.
        people: n, the number of paths.
        independent: Share of a row's evidence that is independent of the other rows', 0 … 1.
        priors: What is known without the boxes.
    """
    rows, cameras, size = seen.residuals.shape
    there = seen.there * (seen.there.sum(axis=1) >= 2.0)[:, None]
    weights = (there[..., None] * _precisions(seen.residuals, there)).reshape(rows, -1, 1)
    # the columns: radius, level, each camera's offsets, the person's size, the residuals
    count = 2 + cameras * len(_EDGES)
    design = np.zeros((rows, cameras, size, count + 2))
    design[:, :, _EDGES, 0] = seen.edges
    design[:, :, 0, 1] = seen.levels
    for camera in range(cameras):
        for number, edge in enumerate(_EDGES):
            design[:, camera, edge, 2 + camera * len(_EDGES) + number] = 1.0
    design[..., count] = upright
    design[..., count + 1] = seen.residuals
    flat = design.reshape(rows, cameras * size, count + 2)
    jacobians = seen.jacobians.reshape(rows, cameras * size, 3)
    weighted, transposed = weights * flat, np.swapaxes(jacobians, 1, 2)
    information, cross = transposed @ (weights * jacobians), transposed @ weighted
    ridge = _WEAK * np.trace(information, axis1=1, axis2=2) + np.finfo(float).tiny
    inverse = np.linalg.inv(information + ridge[:, None, None] * np.eye(3))
    of_rows = np.swapaxes(flat, 1, 2) @ weighted - np.swapaxes(cross, 1, 2) @ inverse @ cross
    of_people = np.zeros((people, count + 2, count + 2))
    np.add.at(of_people, seen.owners, independent * of_rows)
    # a person's size belongs to that person's rows alone, and is eliminated
    own = of_people[:, count] / (of_people[:, count, count] + priors.size**-2.0)[:, None]
    total = (of_people - of_people[:, :, count, None] * own[:, None]).sum(axis=0)
    precisions = np.full(count, priors.offset**-2.0)
    precisions[:2] = priors.radius**-2.0, _LEVEL_SIGMA**-2.0
    precision = total[:count, :count] + np.diag(precisions)
    covariance = np.linalg.inv(precision)
    radius, level = (covariance[:2] @ total[:count, count + 1]).tolist()
    radius = max(radius, 0.0)
    change = -np.linalg.solve(precision[2:, 2:], precision[2:, 0]) * radius
    offsets = np.zeros((cameras, size))
    offsets[:, _EDGES] = change.reshape(cameras, len(_EDGES))
    # boxes do not tell how high all people are: that stays as it was
    lower = (radius * seen.edges + offsets[:, _EDGES]).mean(axis=2)
    offsets[:, _EDGES] -= (lower * there).sum() / max(there.sum(), 1.0)
    return BodyShape(
        radius,
        float(np.sqrt(covariance[0, 0])),
        float(np.sqrt(level**2 + covariance[1, 1])),
        offsets,
        -(own[:, 0] * radius + own[:, 2:count] @ change),
    )


def _precisions(
    residuals: Float[ndarray, "K C m"], there: Float[ndarray, "K C"]
) -> Float[ndarray, " m"]:
    """The inverse variance of each number of a box around its mean, 1 / half heights²."""
    count = max(float(there.sum()), 1.0)
    mean = (residuals * there[..., None]).sum(axis=(0, 1)) / count
    squares = (np.square(residuals - mean) * there[..., None]).sum(axis=(0, 1)) / count
    return np.asarray(1.0 / np.maximum(squares, _LEAST**2))


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
