"""Motion, birth and clutter: the parts of the model that a sequence determines.

[ZW21] Zhu, Wang, "3D target position tracking based on probability hypothesis
density filtering", 2021.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.filters import gaussian_mixture
from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.geometry.camera import Camera
from tracker.parameters.groups.fusion import FusionParams
from tracker.sequences.sequence import Room


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """A linear Gaussian motion model of one step, x ← F x + w with w ~ N(0, Q).

    The state is the position (d = 3), or position and velocity (d = 6), world axes.
    """

    transition: Float[ndarray, "d d"]
    """F, from the state of one step to that of the next."""
    noise: Float[ndarray, "d d"]
    """Q, the covariance of the process noise of one step, in products of m and m/s."""
    start_velocity: float
    """Standard deviation of a newborn target's velocity along each axis, m/s."""

    @staticmethod
    def of(parameters: FusionParams, step_time: float) -> Motion:
        """Make the motion model that the parameters choose, for steps of ``step_time`` seconds."""
        if parameters.motion == "random_walk":
            noise = random_walk_noise(parameters.motion_sigma, step_time, 3)
            return Motion(np.eye(3), noise, 0.0)
        transition, noise = constant_velocity(
            parameters.acceleration_sigma * np.array([1.0, 1.0, parameters.vertical_share]),
            step_time,
            parameters.velocity_memory,
        )
        return Motion(transition, noise, parameters.start_velocity)

    @property
    def dimension(self) -> int:
        """d, the size of the state: 3 for a random walk, 6 with velocity."""
        return len(self.transition)

    def predict(self, mixture: GaussianMixture, survival_probability: float) -> GaussianMixture:
        """Predict every component one step: :func:`tracker.filters.gaussian_mixture.predict`."""
        return gaussian_mixture.predict(mixture, self.transition, self.noise, survival_probability)

    def at_rest(self, mixture: GaussianMixture) -> GaussianMixture:
        """Extend components over positions (metres) to components over the whole state.

        The velocity is 0 with the standard deviation :attr:`start_velocity` along each axis.
        """
        extra = self.dimension - mixture.dimension
        if extra == 0:
            return mixture
        covariances = np.zeros((mixture.size, self.dimension, self.dimension))
        covariances[:, :3, :3] = mixture.covariances
        covariances[:, 3:, 3:] = self.start_velocity**2 * np.eye(extra)
        means = np.concatenate([mixture.means, np.zeros((mixture.size, extra))], axis=1)
        return GaussianMixture(mixture.weights, means, covariances, mixture.labels)


def constant_velocity(
    sigmas: Float[ndarray, " 3"], step_time: float, memory: float
) -> tuple[Float[ndarray, "6 6"], Float[ndarray, "6 6"]]:
    """Compute F and Q of nearly constant velocity, with exponentially decaying velocity.

    The velocity follows dv = −v/τ dt + σ dW (an Ornstein-Uhlenbeck process), so
    that an occluded person is not predicted far beyond a wall. With a = exp(−Δt/τ) and b = 1 − a,
    per axis,

        F = [[1, τ b], [0, a]]
        Q = σ² [[τ² (Δt − 2 τ b + τ (1 − a²)/2), τ² b²/2], [τ² b²/2, τ (1 − a²)/2]]

    For τ → ∞ this is white acceleration: F = [[1, Δt], [0, 1]], Q = σ² [[Δt³/3, Δt²/2], [Δt²/2,
    Δt]].

    Args:
        sigmas: σ along x, y and z, in m/s per √s.
        step_time: Δt in seconds.
        memory: Time constant τ of the velocity, in seconds.
    """
    dt, tau = step_time, memory
    decay = np.exp(-dt / tau)
    reach = tau * (1.0 - decay)
    velocity = tau / 2.0 * (1.0 - decay**2)
    cross = tau**2 / 2.0 * (1.0 - decay) ** 2
    position = tau**2 * (dt - 2.0 * tau * (1.0 - decay) + tau / 2.0 * (1.0 - decay**2))
    transition = np.eye(6)
    transition[:3, 3:] = reach * np.eye(3)
    transition[3:, 3:] = decay * np.eye(3)
    variances = np.diag(sigmas**2)
    noise = np.block(
        [[position * variances, cross * variances], [cross * variances, velocity * variances]]
    )
    return transition, noise


def random_walk_noise(sigma: float, step_time: float, dimension: int) -> Float[ndarray, "d d"]:
    """Compute Q = σ² Δt I, the covariance of one step of a random walk.

    Args:
        sigma: Standard deviation after one second, along each axis, in m/√s.
        step_time: Δt in seconds; by it the walk over a second does not depend on the frame rate.
        dimension: d, the number of axes.
    """
    return sigma**2 * step_time * np.eye(dimension)


def entrance_births(room: Room, weight: float) -> GaussianMixture:
    """The birth intensity γ ([ZW21] §2.4): one component at each entrance, without labels yet.

    A room without entrances gives one broad component over its whole volume, so
    that people are still tracked.

    Args:
        room: The tracked volume, whose entrances have mean and standard deviation in metres.
        weight: Expected number of newborn targets at each entrance in one step.
    """
    if room.entrances:
        means = np.array([entrance.position for entrance in room.entrances])
        sigmas = np.array([entrance.sigma for entrance in room.entrances])
    else:
        means = (room.minimum + room.maximum)[None] / 2.0
        sigmas = (room.maximum - room.minimum)[None] / np.sqrt(12.0)  # of a uniform density
    return GaussianMixture(
        weights=np.full(len(means), weight),
        means=means,
        covariances=sigmas[:, :, None] ** 2 * np.eye(3),
        labels=np.zeros(len(means), dtype=np.int64),
    )


def label_births(births: GaussianMixture, first_label: int) -> GaussianMixture:
    """The same births, each with a label of its own, counted from ``first_label``."""
    labels = np.arange(first_label, first_label + births.size)
    return GaussianMixture(births.weights, births.means, births.covariances, labels)


@lru_cache(maxsize=64)
def visible_area(camera: Camera, room: Room) -> float:
    """The area of the image that the room's volume covers, in squared pixels.

    False boxes are modelled as uniform over it ([ZW21] §2.4: clutter uniform over the volume,
    projected into this camera). It is the area of the convex hull of those of a grid of 12³ points
    of the volume that lie in the image, and at least one per cent of the image, so that the clutter
    intensity stays finite for a camera that does not view the room. With 48³ points the area is
    larger: by 2 to 10 % in the rooms of ``cmc1``, ``cmc2`` and ``av163-seq45-3p-1111-points``, by
    10 to 49 % in the square of ``wildtrack-points-300``. The result is cached for each camera and
    room, since every run needs it.
    """
    axes = np.linspace(room.minimum, room.maximum, 12).T
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    pixels, _ = camera.project(grid)
    pixels = pixels[camera.contains(pixels)]
    width, height = camera.image_size
    if len(pixels) < 3:
        return 0.01 * width * height
    hull = cv2.convexHull(pixels.astype(np.float32))
    return max(float(cv2.contourArea(hull)), 0.01 * width * height)


def measurement_volume(camera: Camera, room: Room, size: int) -> float:
    """The volume of the space of possible boxes, in pixels to the power of ``size``.

    The centre is uniform over :func:`visible_area`. A box's height and width, where they are
    measured, are modelled as uniform up to half of the image's height and width.

    Args:
        camera: The calibrated camera.
        room: The tracked volume.
        size: m, the number of measured components: 2 for the centre, 3 with the height, 4 with the
            width as well.
    """
    width, height = camera.image_size
    volume = visible_area(camera, room)
    if size >= 3:
        volume *= height / 2.0
    if size >= 4:
        volume *= width / 2.0
    return volume
