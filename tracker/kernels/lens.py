"""Pinhole and radial-tangential lens, compiled: forth with its derivative, and back."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tracker.kernels.compilation import kernel


class Calibration(NamedTuple):
    """A calibrated camera."""

    image_size: ndarray
    """(2,) width and height, pixels."""
    rotation: ndarray
    """(3, 3), world to camera axes."""
    translation: ndarray
    """(3,), metres, camera axes."""
    intrinsics: ndarray
    """(3, 3), pixels."""
    distortion: ndarray
    """(5,), k1 k2 p1 p2 k3."""
    nearest_depth: float
    """Metres; what is nearer than this does not count."""
    largest_radius: float
    """What is further aside, in units of the depth, does not count."""


class Calibrations(NamedTuple):
    """C calibrated cameras: the fields of :class:`Calibration`, stacked."""

    image_sizes: ndarray
    """(C, 2)."""
    rotations: ndarray
    """(C, 3, 3)."""
    translations: ndarray
    """(C, 3)."""
    intrinsics: ndarray
    """(C, 3, 3)."""
    distortions: ndarray
    """(C, 5)."""
    nearest_depth: float
    """Of all."""
    largest_radii: ndarray
    """(C,)."""


class Projection(NamedTuple):
    """N world points in a picture."""

    pixels: ndarray
    """(N, 2), NaN where the point does not count."""
    jacobians: ndarray
    """(N, 2, 3) pixels a metre, 0 where the point does not count; or (0, 2, 3)."""
    valid: ndarray
    """(N,), whether it counts."""


@kernel
def one_camera(cameras: Calibrations, index: int) -> Calibration:
    """One of several cameras."""
    return Calibration(
        cameras.image_sizes[index],
        cameras.rotations[index],
        cameras.translations[index],
        cameras.intrinsics[index],
        cameras.distortions[index],
        cameras.nearest_depth,
        cameras.largest_radii[index],
    )


@kernel
def project_points(points: ndarray, camera: Calibration, with_jacobian: bool) -> Projection:
    """Draw world points through a radial-tangential lens.

    Args:
        points: (N, 3), world metres.
        camera: With its lens.
        with_jacobian: Whether the derivative is wanted.
    """
    translation, intrinsics = camera.translation, camera.intrinsics
    nearest_depth, largest_radius = camera.nearest_depth, camera.largest_radius
    count = len(points)
    pixels = np.full((count, 2), np.nan)
    jacobians = np.zeros((count if with_jacobian else 0, 2, 3))
    valid = np.zeros(count, dtype=np.bool_)
    k1, k2, p1, p2, k3 = camera.distortion
    r = camera.rotation
    for n in range(count):
        x, y, z = points[n, 0], points[n, 1], points[n, 2]
        depth = r[2, 0] * x + r[2, 1] * y + r[2, 2] * z + translation[2]
        if not depth > nearest_depth:
            continue
        u = (r[0, 0] * x + r[0, 1] * y + r[0, 2] * z + translation[0]) / depth
        v = (r[1, 0] * x + r[1, 1] * y + r[1, 2] * z + translation[1]) / depth
        r2 = u * u + v * v
        if not r2 < largest_radius * largest_radius:
            continue
        valid[n] = True
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        drawn_u = u * radial + 2.0 * p1 * u * v + p2 * (r2 + 2.0 * u * u)
        drawn_v = v * radial + p1 * (r2 + 2.0 * v * v) + 2.0 * p2 * u * v
        for i in range(2):
            pixels[n, i] = (
                intrinsics[i, 0] * drawn_u + intrinsics[i, 1] * drawn_v + intrinsics[i, 2]
            )
        if not with_jacobian:
            continue
        slope = 2.0 * (k1 + r2 * (2.0 * k2 + 3.0 * k3 * r2))  # d radial / d(r²) · 2
        uu = radial + u * u * slope + 2.0 * p1 * v + 6.0 * p2 * u
        uv = u * v * slope + 2.0 * p1 * u + 2.0 * p2 * v
        vv = radial + v * v * slope + 6.0 * p1 * v + 2.0 * p2 * u
        for i in range(2):
            by_u = intrinsics[i, 0] * uu + intrinsics[i, 1] * uv
            by_v = intrinsics[i, 0] * uv + intrinsics[i, 1] * vv
            for a in range(3):
                jacobians[n, i, a] = (
                    by_u * (r[0, a] - u * r[2, a]) + by_v * (r[1, a] - v * r[2, a])
                ) / depth
    return Projection(pixels, jacobians, valid)


@kernel
def undistort(distorted: ndarray, distortion: ndarray, iterations: int) -> ndarray:
    """Undo the radial-tangential lens model by Newton's method.

    Args:
        distorted: (N, 2), normalised image coordinates as the lens draws them.
        distortion: (5,), k1 k2 p1 p2 k3.
        iterations: At most so many; four or five are enough inside a picture.

    Returns:
        (N, 2), the coordinates that a pinhole would have drawn.
    """
    k1, k2, p1, p2, k3 = distortion
    straight = distorted.copy()
    for n in range(len(distorted)):
        u, v = distorted[n, 0], distorted[n, 1]
        for _ in range(iterations):
            r2 = u * u + v * v
            radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
            slope = 2.0 * (k1 + r2 * (2.0 * k2 + 3.0 * k3 * r2))  # d radial / d(r²) · 2
            error_u = u * radial + 2.0 * p1 * u * v + p2 * (r2 + 2.0 * u * u) - distorted[n, 0]
            error_v = v * radial + p1 * (r2 + 2.0 * v * v) + 2.0 * p2 * u * v - distorted[n, 1]
            a = radial + u * u * slope + 2.0 * p1 * v + 6.0 * p2 * u
            b = u * v * slope + 2.0 * p1 * u + 2.0 * p2 * v
            d = radial + v * v * slope + 6.0 * p1 * v + 2.0 * p2 * u
            determinant = a * d - b * b
            if abs(determinant) < 1e-9:
                break
            step_u = (d * error_u - b * error_v) / determinant
            step_v = (a * error_v - b * error_u) / determinant
            u -= step_u
            v -= step_v
            if step_u * step_u + step_v * step_v < 1e-24:
                break
        straight[n, 0] = u
        straight[n, 1] = v
    return straight


@kernel
def directions(pixels: ndarray, camera: Calibration, iterations: int) -> ndarray:
    """Unit directions of the rays that a lens draws at some pixels: the way back.

    Args:
        pixels: (N, 2).
        camera: With its lens.
        iterations: Of :func:`undistort`; 0 for a pinhole.

    Returns:
        (N, 3), world axes.
    """
    rotation, intrinsics = camera.rotation, camera.intrinsics
    count = len(pixels)
    drawn = np.empty((count, 2))
    determinant = intrinsics[0, 0] * intrinsics[1, 1] - intrinsics[0, 1] * intrinsics[1, 0]
    for n in range(count):
        across, down = pixels[n, 0] - intrinsics[0, 2], pixels[n, 1] - intrinsics[1, 2]
        drawn[n, 0] = (intrinsics[1, 1] * across - intrinsics[0, 1] * down) / determinant
        drawn[n, 1] = (intrinsics[0, 0] * down - intrinsics[1, 0] * across) / determinant
    straight = undistort(drawn, camera.distortion, iterations)
    rays = np.empty((count, 3))
    for n in range(count):
        u, v = straight[n]
        length = math.sqrt(u * u + v * v + 1.0)
        for a in range(3):
            rays[n, a] = (u * rotation[0, a] + v * rotation[1, a] + rotation[2, a]) / length
    return rays
