"""The targets of one camera: constant velocity, gates, and the update by weighted measurements.

[FBS83] Fortmann, Bar-Shalom, Scheffe, "Sonar tracking of multiple targets using joint
probabilistic data association", IEEE Journal of Oceanic Engineering 8(3), 1983.
"""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass, fields, replace

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.filters.gaussian_mixture import GaussianMixture

X, Y = 0, 2
"""Where the position stands in the state."""


@dataclass(frozen=True, slots=True, eq=False)
class Targets:
    """n targets: state [p_x, v_x, p_y, v_y] in pixels and pixels per second, and a box."""

    means: Float[ndarray, "n 4"]
    covariances: Float[ndarray, "n 4 4"]
    half_sizes: Float[ndarray, "n 2"]
    """Half width and half height, smoothed, pixels."""
    labels: Int[ndarray, " n"]
    """Ids within this camera; 0 for a newcomer that does not count yet."""
    hits: Int[ndarray, " n"]
    """At how many steps in a row it was measured, or hidden by who was."""
    misses: Int[ndarray, " n"]
    """At how many steps in a row it was not."""
    hidden: Int[ndarray, " n"]
    """At how many steps in a row it was occluded; 0 where it is not."""

    @staticmethod
    def empty() -> Targets:
        """Nobody."""
        none = np.zeros(0, dtype=np.int64)
        return Targets(
            np.zeros((0, 4)), np.zeros((0, 4, 4)), np.zeros((0, 2)), none, none, none, none
        )

    @staticmethod
    def at_rest(
        boxes: Float[ndarray, "n 4"],
        sigmas: Float[ndarray, "n 4"],
        velocity_sigma: float,
        labels: Int[ndarray, " n"],
    ) -> Targets:
        """Targets where something was measured, whose velocity is not known: 0, unsure.

        Args:
            boxes: Pixels.
            sigmas: Of the boxes' numbers.
            velocity_sigma: Half sizes a second.
            labels: 0 for who does not count yet.
        """
        count = len(boxes)
        means, covariances = np.zeros((count, 4)), np.zeros((count, 4, 4))
        means[:, [X, Y]] = boxes[:, :2]
        covariances[:, [X, Y], [X, Y]] = sigmas[:, :2] ** 2
        speeds = velocity_sigma * scale_of(boxes[:, 2:])
        covariances[:, [X + 1, Y + 1], [X + 1, Y + 1]] = speeds[:, None] ** 2
        zero = np.zeros(count, dtype=np.int64)
        return Targets(means, covariances, boxes[:, 2:].copy(), labels, zero + 1, zero, zero)

    @property
    def size(self) -> int:
        """n."""
        return len(self.labels)

    @property
    def positions(self) -> Float[ndarray, "n 2"]:
        """Pixels."""
        return self.means[:, [X, Y]]

    @property
    def boxes(self) -> Float[ndarray, "n 4"]:
        """Centre and half sizes."""
        return np.concatenate([self.positions, self.half_sizes], axis=1)

    @property
    def place_covariances(self) -> Float[ndarray, "n 2 2"]:
        """Of the positions, pixels squared."""
        return self.covariances[:, [[X], [Y]], [[X, Y]]]

    def take(self, indices: ndarray) -> Targets:
        """Some of them."""
        return Targets(**{f.name: getattr(self, f.name)[indices] for f in fields(self)})

    def predict(self, step_time: float, acceleration_sigma: float) -> Targets:
        """One step ahead at constant velocity, under white acceleration:

            F = [[1, T], [0, 1]],  Q = q [[T³/3, T²/2], [T²/2, T]]

        for either axis, with q = (σ_a × size)².

        Args:
            step_time: T, seconds.
            acceleration_sigma: σ_a, half sizes per s^1.5.
        """
        t = step_time
        axis, noise = (
            np.array([[1.0, t], [0.0, 1.0]]),
            np.array([[t**3 / 3, t**2 / 2], [t**2 / 2, t]]),
        )
        transition, both = np.kron(np.eye(2), axis), np.kron(np.eye(2), noise)
        power = (acceleration_sigma * scale_of(self.half_sizes)) ** 2
        return replace(
            self,
            means=self.means @ transition.T,
            covariances=transition @ self.covariances @ transition.T + power[:, None, None] * both,
        )

    def as_boxes(self, sigmas: Float[ndarray, "n 4"]) -> GaussianMixture:
        """An intensity over boxes: one person each, as sure of the sizes as the sigmas say."""
        covariances = np.zeros((self.size, 4, 4))
        covariances[:, :2, :2] = self.place_covariances
        covariances[:, [2, 3], [2, 3]] = sigmas[:, 2:] ** 2
        return GaussianMixture(np.ones(self.size), self.boxes, covariances, self.labels)


def concatenate(parts: Many[Targets]) -> Targets:
    """All of them, one after the other."""
    return Targets(
        **{f.name: np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(Targets)}
    )


def scale_of(half_sizes: Float[ndarray, "n 2"]) -> Float[ndarray, " n"]:
    """The size that a target's motion is measured by: the geometric mean, half a pixel at least."""
    return np.asarray(np.sqrt(np.maximum(half_sizes, 0.5).prod(axis=1)))


@dataclass(frozen=True, slots=True, eq=False)
class Innovations:
    """How every measurement lies to every target's prediction."""

    offsets: Float[ndarray, "n M 2"]
    """ν_tj = z_j − H x_t, pixels."""
    covariances: Float[ndarray, "n M 2 2"]
    """S_tj = H P_t Hᵀ + R_j."""
    precisions: Float[ndarray, "n M 2 2"]
    squared: Float[ndarray, "n M"]
    """ν_tjᵀ S_tj⁻¹ ν_tj."""
    densities: Float[ndarray, "n M"]
    """Λ_tj = N(ν_tj; 0, S_tj), per square pixel."""


def innovations(
    targets: Targets, places: Float[ndarray, "M 2"], sigmas: Float[ndarray, "M 2"]
) -> Innovations:
    """Set every measurement against every target.

    Args:
        targets: Predicted.
        places: z_j, pixels.
        sigmas: Standard deviations of the places, pixels.
    """
    offsets = places[None] - targets.positions[:, None]
    noise = np.maximum(sigmas, 1e-3)[:, :, None] ** 2 * np.eye(2)
    covariances = targets.place_covariances[:, None] + noise[None]
    precisions = np.linalg.inv(covariances)
    squared = np.einsum("nma,nmab,nmb->nm", offsets, precisions, offsets)
    determinants = np.linalg.det(covariances)
    densities = np.exp(-0.5 * squared) / (2.0 * np.pi * np.sqrt(determinants))
    return Innovations(offsets, covariances, precisions, squared, densities)


def update(targets: Targets, found: Innovations, detected: Float[ndarray, "n M"]) -> Targets:
    """The mean over all associations, and the covariance around it ([FBS83]_).

    A target's posterior is a mixture: with probability β_t0 no measurement is its own and
    the prediction stands, with β_tj the Kalman update by measurement j holds, with gain
    W = P Hᵀ S⁻¹. Its first two moments are, for measurements of equal noise,

        x ← x + W Σ_j β_tj ν_tj
        P ← β_t0 P + (1 − β_t0) (P − W S Wᵀ) + W (Σ_j β_tj ν_tj ν_tjᵀ − ν_t ν_tᵀ) Wᵀ

    Here each measurement may have a noise of its own.

    Args:
        targets: Predicted.
        found: Of the same targets.
        detected: β_tj; what a row lacks of 1 is β_t0.
    """
    gains = targets.covariances[:, None][..., [X, Y]] @ found.precisions
    moves = np.einsum("nmab,nmb->nma", gains, found.offsets)
    mean_moves = np.einsum("nm,nma->na", detected, moves)
    lost = gains @ found.covariances @ gains.transpose(0, 1, 3, 2)
    spread = np.einsum("nm,nma,nmb->nab", detected, moves, moves)
    spread -= mean_moves[:, :, None] * mean_moves[:, None]
    covariances = targets.covariances - np.einsum("nm,nmab->nab", detected, lost) + spread
    return replace(
        targets,
        means=targets.means + mean_moves,
        covariances=(covariances + covariances.transpose(0, 2, 1)) / 2.0,
    )
