"""The targets of one camera: motion, gates, the update by weighted measurements, and management.

Targets begin, end, or return by place ([WW10]): a measurement without a target continues a vanished
target in whose predicted gate it lies. The two other trackers of published methods decide by other
evidence, so each has a track management of its own:
:mod:`~tracker.single_view.pseudo_particle.track_management` by the person whose colours a target
has, and :mod:`~tracker.single_view.association_matrix.track_transfer` by the objects that several
tracks may share.

[FBS83] Fortmann, Bar-Shalom, Scheffe, "Sonar tracking of multiple targets using joint
probabilistic data association", IEEE Journal of Oceanic Engineering 8(3), 1983.
[WW10] Wang, Wan, "Fast tracking of multiple targets in video by joint probabilistic
data association", patent CN101783020A, 2010.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.geometry.assignment import linear_sum_assignment
from tracker.parameters.groups.jpda import JpdaParams
from tracker.single_view.jpda.measurements import Measured
from tracker.steps.table import Table

X, Y = 0, 2
"""Indices of the position in the state."""


@dataclass(frozen=True, slots=True, eq=False)
class Targets(Table):
    """n targets: state [p_x, v_x, p_y, v_y] in pixels and pixels per second, and a box."""

    means: Float[ndarray, "n 4"]
    """State of each target."""
    covariances: Float[ndarray, "n 4 4"]
    """Covariance of each state."""
    half_sizes: Float[ndarray, "n 2"]
    """Half width and half height, smoothed, pixels."""
    labels: Int[ndarray, " n"]
    """Ids within this camera; 0 for a new target that is not confirmed yet."""
    hits: Int[ndarray, " n"]
    """Number of consecutive steps with a measurement, own or of the occluder."""
    misses: Int[ndarray, " n"]
    """Number of consecutive steps without a measurement."""
    hidden: Int[ndarray, " n"]
    """Number of consecutive steps of occlusion; 0 for a target that is not occluded."""

    @staticmethod
    def empty() -> Targets:
        """No targets."""
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
        """Make targets at measurements, with velocity 0 and its standard deviation.

        Args:
            boxes: Centre and half sizes of n boxes, pixels.
            sigmas: Standard deviations of these four numbers, pixels.
            velocity_sigma: Standard deviation of the velocity, half sizes per second.
            labels: Id of each target; 0 for one that is not confirmed yet.
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
        """The number of targets n."""
        return len(self.labels)

    @property
    def positions(self) -> Float[ndarray, "n 2"]:
        """Position of each target, pixels."""
        return self.means[:, [X, Y]]

    @property
    def boxes(self) -> Float[ndarray, "n 4"]:
        """Centre and half sizes of each target, pixels."""
        return np.concatenate([self.positions, self.half_sizes], axis=1)

    @property
    def place_covariances(self) -> Float[ndarray, "n 2 2"]:
        """Covariance of each position, squared pixels."""
        return self.covariances[:, [[X], [Y]], [[X, Y]]]

    def predict(self, step_time: float, acceleration_sigma: float) -> Targets:
        """Predict one step at constant velocity with white acceleration.

            F = [[1, T], [0, 1]],  Q = q [[T³/3, T²/2], [T²/2, T]]

        for either axis, with q = (σ_a size)² and the size of :func:`scale_of`.

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
        """Convert the targets to an intensity over boxes, with the weight 1 each.

        Args:
            sigmas: Standard deviations of the n boxes, of which those of the half sizes are used,
                pixels.
        """
        covariances = np.zeros((self.size, 4, 4))
        covariances[:, :2, :2] = self.place_covariances
        covariances[:, [2, 3], [2, 3]] = sigmas[:, 2:] ** 2
        return GaussianMixture(np.ones(self.size), self.boxes, covariances, self.labels)


def scale_of(half_sizes: Float[ndarray, "n 2"]) -> Float[ndarray, " n"]:
    """The scale of a target's motion: the geometric mean of its half sizes, at least 0.5 px."""
    return np.asarray(np.sqrt(np.maximum(half_sizes, 0.5).prod(axis=1)))


@dataclass(frozen=True, slots=True, eq=False)
class Innovations:
    """The innovations of n targets and M measurements."""

    offsets: Float[ndarray, "n M 2"]
    """Innovations ν_tj = z_j − H x_t, pixels."""
    covariances: Float[ndarray, "n M 2 2"]
    """Innovation covariances S_tj = H P_t Hᵀ + R_j, square pixels."""
    precisions: Float[ndarray, "n M 2 2"]
    """S_tj⁻¹."""
    squared: Float[ndarray, "n M"]
    """Squared Mahalanobis distances ν_tjᵀ S_tj⁻¹ ν_tj."""
    densities: Float[ndarray, "n M"]
    """Λ_tj = N(ν_tj; 0, S_tj), per square pixel."""


def innovations(
    targets: Targets, places: Float[ndarray, "M 2"], sigmas: Float[ndarray, "M 2"]
) -> Innovations:
    """Compute the innovation of every target and measurement.

    Args:
        targets: n predicted targets.
        places: z_j, positions of M measurements, pixels.
        sigmas: Standard deviations of the places along x and y, pixels.
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
    """Update by the mean over all associations, with the covariance around it ([FBS83]_).

    The posterior of a target is a mixture: with probability β_t0 it has no measurement and
    remains as predicted, with β_tj it is updated by measurement j, with the Kalman gain
    W = P Hᵀ S⁻¹. The first two moments of the mixture are, for measurements of equal noise,

        x ← x + W Σ_j β_tj ν_tj
        P ← β_t0 P + (1 − β_t0) (P − W S Wᵀ) + W (Σ_j β_tj ν_tj ν_tjᵀ − ν_t ν_tᵀ) Wᵀ

    Here each measurement may have its own noise.

    Args:
        targets: n predicted targets.
        found: Innovations of the same targets.
        detected: β_tj, association probabilities; β_t0 is 1 less the sum of a row.
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


FAR = 1e9
"""Squared distance of an inadmissible pair: more than the sum of all distances inside gates."""


@dataclass(frozen=True, slots=True, eq=False)
class Managed:
    """The targets after the track management of one step, and its decisions."""

    targets: Targets
    """The targets that remain, followed by the returned and by the new ones."""
    vanished: Targets
    """The targets that vanished recently."""
    next_label: int
    """The first label that is free."""
    stayed: Int[ndarray, " s"]
    """Indices, before, of the targets that remain."""
    sources: Int[ndarray, " a"]
    """Measurement of each returned and then of each new target."""
    new_labels: tuple[int, ...]
    """Ids of the targets that were confirmed at this step."""
    returned_labels: tuple[int, ...]
    """Ids of the targets that returned."""
    vanished_labels: tuple[int, ...]
    """Ids of the targets that vanished."""


def manage(
    targets: Targets,
    vanished: Targets,
    next_label: int,
    new: Bool[ndarray, " M"],
    seen: Measured,
    parameters: JpdaParams,
    *,
    gate: float,
    longest_hidden: int,
) -> Managed:
    """End targets, and begin or continue targets at measurements without a target.

    Args:
        targets: The targets after the update of this step.
        vanished: Vanished targets, predicted to this step; misses since the last measurement.
        next_label: The first label that is free.
        new: The measurements without a target.
        seen: All measurements.
        parameters: The numbers of steps for confirmation and end.
        gate: Largest squared Mahalanobis distance of a vanished target and its measurement.
        longest_hidden: Number of steps after which an occluded target ends.
    """
    p = parameters
    counts = targets.labels > 0
    gone = np.where(
        counts,
        (targets.misses >= p.vanish_steps) | (targets.hidden >= longest_hidden),
        (targets.misses > 0) | (targets.hidden > 0),  # a new target must be measured at every step
    )
    kept, lost = targets.take(np.flatnonzero(~gone)), targets.take(np.flatnonzero(gone & counts))
    places = np.flatnonzero(new)
    back, where = np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    if p.five_cases:
        back, where = _pair_returned(vanished, seen, places, gate)
    fresh = np.setdiff1d(places, where)
    returned = Targets.at_rest(
        np.concatenate([seen.boxes[where, :2], vanished.half_sizes[back]], axis=1),
        seen.sigmas[where],
        p.velocity_sigma,
        vanished.labels[back],
    )
    newcomers = Targets.at_rest(
        seen.boxes[fresh],
        seen.sigmas[fresh],
        p.velocity_sigma,
        np.zeros(len(fresh), dtype=np.int64),
    )
    after = Targets.concatenate([kept, returned, newcomers])
    counting = np.flatnonzero((after.labels == 0) & (after.hits >= p.confirmation_steps))
    labels = after.labels.copy()
    labels[counting] = next_label + np.arange(len(counting))
    still = vanished.take(np.setdiff1d(np.arange(vanished.size), back))
    still = still.take(np.flatnonzero(still.misses < p.vanish_steps + p.return_steps))
    lost = replace(lost, misses=np.full(lost.size, p.vanish_steps))
    return Managed(
        targets=replace(after, labels=labels),
        vanished=Targets.concatenate([still, lost]),
        next_label=next_label + len(counting),
        stayed=np.flatnonzero(~gone),
        sources=np.concatenate([where, fresh]),
        new_labels=tuple(labels[counting].tolist()),
        returned_labels=tuple(returned.labels.tolist()),
        vanished_labels=tuple(lost.labels.tolist()),
    )


def _pair_returned(
    vanished: Targets, seen: Measured, places: Int[ndarray, " m"], gate: float
) -> tuple[Int[ndarray, " r"], Int[ndarray, " r"]]:
    """Pair vanished targets with measurements, one to one.

    As many pairs as possible are made inside the gates, with the least sum of squared Mahalanobis
    distances.

    Returns:
        Indices of the vanished targets, and the measurement of each.
    """
    found = innovations(vanished, seen.boxes[places, :2], seen.sigmas[places, :2])
    distances: Float[ndarray, "v m"] = np.where(found.squared <= gate, found.squared, FAR)
    rows, columns = linear_sum_assignment(distances)
    near = distances[rows, columns] < FAR
    return rows[near], places[columns[near]]
