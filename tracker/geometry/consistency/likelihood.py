"""The likelihood of the boxes of some cameras given those of the others, for one calibration.

The scene has three nuisance values in the world of the file: the rise r from foot to head, which is
common to all people, the floor n·x = f, and its scatter τ. Given them the N_a boxes of camera a
predict the boxes of camera b at the same moment, and a box z of camera b has the density

    p(z | a) = p_b(z) [1 − q + (q / N_a) Σ_i N(z; μ_i, S_i) / p_b(z)],

where p_b is the density of camera b's own boxes, whoever they are of (places uniform, heights
log-normal), and 1 − q is the share of boxes that camera a does not explain. The evidence is

    E = (1 / (C − 1)) Σ_{a ≠ b} max_q Σ_z log(p(z | a) / p_b(z)),

in nats: what the other cameras tell of a camera's boxes. Since q may be 0, it is not negative.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from collections.abc import Sequence as Many
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.geometry.consistency.observed import Pose, Rays, in_world
from tracker.kernels import consistency as kernels

SIGMA = 0.07
"""σ: deviation of a box's ends, in heights of the box. In the random rooms of seeds 1200 … 1205 all
readings are decided, and are the same, from 0.035 to 0.14."""

HEIGHT_SIGMA = 0.12
"""σ_H: deviation of people's heights, in the common height. In these rooms all readings are
decided, and are the same, from 0.06 to 0.12."""

# Halved and doubled, these leave all interpretations of the random rooms of seeds 1300 … 1303 as
# they are, correct and with one mistake each.
_LEAST_SCATTER = 0.01  # of a person's height: τ
_LEAST_SPREAD = 0.1  # least deviation of the logarithm of a camera's boxes' heights
_AHEAD = 0.02  # least z of a unit direction on the image plane
_SHORTH = 0.4  # share of the feet within the interval whose middle is the floor


@dataclass(frozen=True, slots=True, eq=False)
class Moments:
    """The N boxes of one camera at M moments, as directions in its own axes."""

    starts: Int[ndarray, " M1"]
    """Index of the first box of each moment, and N."""
    heads: Float[ndarray, "N 3"]
    feet: Float[ndarray, "N 3"]
    whole: Bool[ndarray, " N"]
    """False where a box is clipped by the image's edge."""
    seen: Float[ndarray, "N 4"]
    """x and y of foot and head at distance 1 ahead."""
    background: Float[ndarray, " N"]
    """log p_b(z), NaN for a box that is not compared."""


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """How people stand, in the world of the file."""

    rise: Float[ndarray, " 3"]
    """r, from foot to head."""
    floor: float
    """f, of n·x = f with the unit vector n along the rise."""
    scatter: float
    """τ, the deviation of feet from the floor."""


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """E of one calibration, and its parts."""

    terms: Mapping[tuple[int, int], Float[ndarray, " M"]]
    """Nats by moment of the boxes of camera b given those of camera a, by (a, b)."""
    explained: Mapping[tuple[int, int], float]
    """q by (a, b)."""
    cameras: int
    """C: number of cameras that have boxes."""
    moments: int
    """M."""

    @property
    def by_moment(self) -> Float[ndarray, " M"]:
        """E by moment, nats."""
        return self._sum(self.terms.values())

    @property
    def total(self) -> float:
        """E, nats."""
        return float(self.by_moment.sum())

    def of_camera(self, camera: int) -> Float[ndarray, " M"]:
        """The part of the pairs with one camera, by moment, nats."""
        return self._sum(own for key, own in self.terms.items() if camera in key)

    def _sum(self, terms: Iterable[Float[ndarray, " M"]]) -> Float[ndarray, " M"]:
        rows = list(terms)
        total = np.sum(rows, axis=0) if rows else np.zeros(self.moments)
        return np.asarray(total / max(self.cameras - 1, 1))

    def of_cameras(self) -> dict[int, float]:
        """The mean share of the boxes of each camera's pairs that are explained, 0 … 1."""
        cameras = {camera for pair in self.explained for camera in pair}
        return {
            camera: float(np.mean([q for pair, q in self.explained.items() if camera in pair]))
            for camera in cameras
        }

    @property
    def share(self) -> float:
        """The mean share of a camera's boxes that another one explains, 0 … 1."""
        return float(np.mean(list(self.explained.values()))) if self.explained else 0.0


def at_moments(
    rays: Rays, moments: Int[ndarray, " M"], plane: tuple[ndarray, ndarray] | None = None
) -> Moments:
    """Select the boxes of some steps.

    Args:
        rays: Boxes of one camera, sorted by step.
        moments: Steps, in any order.
        plane: What :func:`on_image_plane` returns for these boxes, where it is known.
    """
    first = np.searchsorted(rays.frames, moments, "left")
    counts = np.searchsorted(rays.frames, moments, "right") - first
    starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    rows = np.arange(starts[-1]) - np.repeat(starts[:-1] - first, counts)
    seen, background = on_image_plane(rays) if plane is None else plane
    return Moments(
        starts, rays.heads[rows], rays.feet[rows], rays.whole[rows], seen[rows], background[rows]
    )


def fit_floor(rise: Float[ndarray, " 3"], feet: Float[ndarray, "N 3"]) -> Scene:
    """Fit the floor as the mode of triangulated feet along the rise.

    The mode is the middle of the shortest interval with 40 % of the feet, and the scatter the
    median absolute deviation of those within it and as far around it.

    Args:
        rise: From foot to head.
        feet: Triangulated feet.
    """
    height = float(np.linalg.norm(rise))
    normal = rise / height
    along = np.sort(feet @ normal)
    inside = max(2, round(_SHORTH * len(along)))
    if len(along) < 2:
        return Scene(rise, float(along[0]) if len(along) else 0.0, height)
    widths = along[inside - 1 :] - along[: len(along) - inside + 1]
    at = int(np.argmin(widths))
    middle, width = 0.5 * (along[at] + along[at + inside - 1]), float(widths[at])
    near = along[np.abs(along - middle) <= max(1.5 * width, 1e-12)]
    scatter = 1.4826 * float(np.median(np.abs(near - np.median(near))))
    return Scene(rise, float(np.median(near)), max(scatter, _LEAST_SCATTER * height))


def evidence(
    boxes: Many[Moments | None],
    poses: Many[Pose],
    scene: Scene,
    *,
    among: Bool[ndarray, "C C"] | None = None,
) -> Evidence:
    """Compute E of some cameras' boxes.

    Args:
        boxes: The boxes of each camera at the same moments; None for a camera without any.
        poses: Pose of each camera.
        scene: How people stand.
        among: Which pairs (a, b) are compared; all where it is not given.
    """
    seen = {camera: own for camera, own in enumerate(boxes) if own is not None and len(own.heads)}
    moments = max((len(own.starts) - 1 for own in boxes if own is not None), default=0)
    if not seen:
        return Evidence({}, {}, 0, moments)
    there, own = list(seen), list(seen.values())
    firsts = np.cumsum([0, *(len(box.heads) for box in own[:-1])])
    compared = ~np.eye(len(there), dtype=bool)
    if among is not None:
        compared &= among[np.ix_(there, there)]
    height = float(np.linalg.norm(scene.rise))
    nats, explained = kernels.pair_evidence(
        np.concatenate([in_world(poses[c], box.feet) for c, box in zip(there, own, strict=True)]),
        np.concatenate([in_world(poses[c], box.heads) for c, box in zip(there, own, strict=True)]),
        np.concatenate([box.whole for box in own]),
        np.concatenate([box.seen for box in own]),
        np.concatenate([box.background for box in own]),
        np.array([first + box.starts for first, box in zip(firsts, own, strict=True)]),
        np.array([poses[camera].rotation for camera in there]),
        np.array([poses[camera].centre for camera in there]),
        compared,
        np.array([*scene.rise, *(scene.rise / height), scene.floor, scene.scatter]),
        SIGMA,
        HEIGHT_SIGMA,
    )
    pairs = [(int(a), int(b)) for a, b in np.argwhere(compared)]
    return Evidence(
        {(there[a], there[b]): nats[a, b] for a, b in pairs},
        {(there[a], there[b]): float(explained[a, b]) for a, b in pairs},
        len(there),
        moments,
    )


def on_image_plane(own: Rays) -> tuple[Float[ndarray, "N 4"], Float[ndarray, " N"]]:
    """Compute feet and heads at distance 1 ahead, and log p_b of each box of a camera."""
    good = own.whole & (own.feet[:, 2] > _AHEAD) & (own.heads[:, 2] > _AHEAD)
    with np.errstate(all="ignore"):
        feet = own.feet[:, :2] / own.feet[:, 2:]
        heads = own.heads[:, :2] / own.heads[:, 2:]
    seen = np.where(good[:, None], np.concatenate([feet, heads], axis=1), 0.0)
    heights = np.linalg.norm(seen[:, 2:] - seen[:, :2], axis=1)
    good &= heights > 0.0
    background = np.full(len(seen), np.nan)
    if not good.any():
        return seen, background
    logs = np.log(heights[good])
    middle, spread = float(np.median(logs)), max(float(logs.std()), _LEAST_SPREAD)
    extent = np.ptp(seen[good, :2], axis=0) + np.exp(middle)
    density = -np.log(spread * np.sqrt(2.0 * np.pi)) - 0.5 * ((logs - middle) / spread) ** 2 - logs
    background[good] = density - np.log(extent[0] * extent[1])
    return seen, background
