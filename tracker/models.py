"""Motion, birth and clutter: the parts of the model that a sequence determines."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.camera import Camera
from tracker.gaussian_mixture import GaussianMixture
from tracker.sequences.sequence import Room


def random_walk_noise(sigma: float, step_time: float, dimension: int) -> Float[ndarray, "d d"]:
    """Q = σ² Δt I: the covariance of one step of a random walk.

    Args:
        sigma: Spread after one second, along each axis, in m/√s.
        step_time: Δt in seconds, so that the frame rate does not change the walk.
        dimension: d.
    """
    return sigma**2 * step_time * np.eye(dimension)


def entrance_births(room: Room, weight: float) -> GaussianMixture:
    """The birth intensity γ: one component at each entrance, without labels yet.

    A room without entrances gives one broad component over its whole volume, so
    that people are still found.

    Args:
        room: Entrances with mean and standard deviation in metres.
        weight: Expected number of newcomers at each entrance in one step.
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


def visible_area(camera: Camera, room: Room) -> float:
    """Area of the picture that the room's volume fills, in squared pixels.

    False boxes are taken as uniform over it ([ZW21] §2.4: clutter uniform over
    the volume, as this camera sees it). Never less than one per cent of the
    picture, so that the clutter intensity stays finite for a camera that looks
    elsewhere.
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
