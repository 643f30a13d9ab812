"""Camera projection, pinhole with lens distortion, compiled: with its derivative, and inverted."""

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
    """(5,), k1 k2 p1 p2 k3, or the :data:`GENERAL` numbers of another model."""
    nearest_depth: float
    """Depth below which a point is invalid, metres."""
    largest_radius: float
    """Radius, in units of the depth, beyond which a point is invalid."""


class Calibrations(NamedTuple):
    """C calibrated cameras: the fields of :class:`Calibration`, stacked."""

    image_sizes: ndarray
    """(C, 2), width and height, pixels."""
    rotations: ndarray
    """(C, 3, 3), world to camera axes."""
    translations: ndarray
    """(C, 3), metres, camera axes."""
    intrinsics: ndarray
    """(C, 3, 3), pixels."""
    distortions: ndarray
    """(C, 5), or (C, :data:`GENERAL`) where a lens has another model."""
    nearest_depth: float
    """Depth below which a point is invalid, metres, for all cameras."""
    largest_radii: ndarray
    """(C,), radii beyond which a point is invalid."""


class Projection(NamedTuple):
    """N world points in an image."""

    pixels: ndarray
    """(N, 2), NaN where the point is invalid."""
    jacobians: ndarray
    """(N, 2, 3) pixels per metre, 0 where the point is invalid; or (0, 2, 3)."""
    valid: ndarray
    """(N,), whether the point is valid."""


@kernel
def one_camera(cameras: Calibrations, index: int) -> Calibration:
    """Select one of several cameras."""
    return Calibration(
        cameras.image_sizes[index],
        cameras.rotations[index],
        cameras.translations[index],
        cameras.intrinsics[index],
        cameras.distortions[index],
        cameras.nearest_depth,
        cameras.largest_radii[index],
    )


GENERAL = 9
"""Number of coefficients of a general lens: k1 k2 p1 p2 k3 k4 k5 k6, and 1 if a fisheye, else 0."""


@kernel
def bend(r2: float, distortion: ndarray) -> tuple[float, float]:
    """The radial factor of a lens, and twice its derivative by r².

    Plain: 1 + k1 r² + k2 r⁴ + k3 r⁶; rational: that, divided by 1 + k4 r² + k5 r⁴ + k6 r⁶;
    fisheye: θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸) / r with r = tan θ (OpenCV, calib3d; the
    latter Kannala, Brandt, IEEE TPAMI 28(8), 2006, equation 6).

    Args:
        r2: Squared radius, in units of the depth.
        distortion: Coefficients, as in :class:`Calibration`.
    """
    k1, k2, k3 = distortion[0], distortion[1], distortion[4]
    if len(distortion) == GENERAL and distortion[8] > 0.0:
        if r2 < 1e-8:  # the first terms of the series
            return 1.0 + (k1 - 1.0 / 3.0) * r2, 2.0 * (k1 - 1.0 / 3.0)
        r = math.sqrt(r2)
        angle = math.atan(r)
        a2 = angle * angle
        k4 = distortion[5]
        drawn = angle * (1.0 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4))))
        rise = 1.0 + a2 * (3.0 * k1 + a2 * (5.0 * k2 + a2 * (7.0 * k3 + a2 * 9.0 * k4)))
        return drawn / r, (rise / (1.0 + r2) - drawn / r) / r2
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = 2.0 * (k1 + r2 * (2.0 * k2 + 3.0 * k3 * r2))
    if len(distortion) == GENERAL:
        k4, k5, k6 = distortion[5], distortion[6], distortion[7]
        below = 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6))
        fall = 2.0 * (k4 + r2 * (2.0 * k5 + 3.0 * k6 * r2))
        return radial / below, (slope - fall * radial / below) / below
    return radial, slope


@kernel
def unbend_fisheye(drawn: float, distortion: ndarray, iterations: int) -> float:
    """tan θ / θ_d of a point that a fisheye projects at radius θ_d, by Newton's method on θ."""
    if drawn < 1e-8:
        return 1.0
    k1, k2, k3, k4 = distortion[0], distortion[1], distortion[4], distortion[5]
    angle = min(drawn, 1.5)
    for _ in range(iterations):
        a2 = angle * angle
        error = angle * (1.0 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4)))) - drawn
        rise = 1.0 + a2 * (3.0 * k1 + a2 * (5.0 * k2 + a2 * (7.0 * k3 + a2 * 9.0 * k4)))
        if rise < 1e-6:
            break
        step = error / rise
        # the image plane holds angles of less than 90 degrees
        angle = min(max(angle - step, 1e-9), 1.57)
        if step * step < 1e-24:
            break
    return math.tan(angle) / drawn


@kernel
def project_points(points: ndarray, camera: Calibration, with_jacobian: bool) -> Projection:
    """Project world points through a lens.

    Args:
        points: (N, 3), world metres.
        camera: The calibrated camera.
        with_jacobian: Whether the derivative is computed.
    """
    translation, intrinsics = camera.translation, camera.intrinsics
    nearest_depth, largest_radius = camera.nearest_depth, camera.largest_radius
    count = len(points)
    pixels = np.full((count, 2), np.nan)
    jacobians = np.zeros((count if with_jacobian else 0, 2, 3))
    valid = np.zeros(count, dtype=np.bool_)
    distortion = camera.distortion
    p1, p2 = distortion[2], distortion[3]
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
        radial, slope = bend(r2, distortion)
        drawn_u = u * radial + 2.0 * p1 * u * v + p2 * (r2 + 2.0 * u * u)
        drawn_v = v * radial + p1 * (r2 + 2.0 * v * v) + 2.0 * p2 * u * v
        for i in range(2):
            pixels[n, i] = (
                intrinsics[i, 0] * drawn_u + intrinsics[i, 1] * drawn_v + intrinsics[i, 2]
            )
        if not with_jacobian:
            continue
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
    """Invert the lens model by Newton's method.

    Args:
        distorted: (N, 2), normalised image coordinates with distortion.
        distortion: Coefficients, as in :class:`Calibration`.
        iterations: Largest number of iterations; four or five suffice inside an image.

    Returns:
        (N, 2), normalised coordinates without distortion.
    """
    p1, p2 = distortion[2], distortion[3]
    straight = distorted.copy()
    for n in range(len(distorted)):
        u, v = distorted[n, 0], distorted[n, 1]
        if len(distortion) == GENERAL and distortion[8] > 0.0:
            stretch = unbend_fisheye(math.sqrt(u * u + v * v), distortion, iterations)
            straight[n, 0] = u * stretch
            straight[n, 1] = v * stretch
            continue
        for _ in range(iterations):
            r2 = u * u + v * v
            radial, slope = bend(r2, distortion)
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
    """Compute the unit directions of the rays through pixels.

    Args:
        pixels: (N, 2), x and y, pixels.
        camera: The calibrated camera.
        iterations: Largest number of iterations of :func:`undistort`; 0 for a pinhole.

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
