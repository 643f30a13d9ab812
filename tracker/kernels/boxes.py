"""Expected boxes of upright targets in a camera, their visibility and occlusion, compiled."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tracker.kernels.compilation import kernel
from tracker.kernels.lens import Calibration, project_points


class UprightBoxes(NamedTuple):
    """The predicted boxes of J upright targets in a camera."""

    values: ndarray
    """(J, m), predicted measurements, pixels."""
    jacobians: ndarray
    """(J, m, d), derivatives of the measurements by the state, pixels per metre."""
    boxes: ndarray
    """(J, 4) left, top, right and bottom, not clipped, pixels."""
    depths: ndarray
    """(J,), distance from the lens, metres."""
    valid: ndarray
    """(J,), whether middle, head and foot lie in front of the lens."""


class Occlusion(NamedTuple):
    """Parameters of the occlusion of targets by others in front of them."""

    near: float
    """Distance within which an occluder may be a duplicate, which does not occlude, metres."""
    strength: float
    """ρ, 0 … 1, the factor on every occlusion."""
    reporting_share: float
    """Share of a box that must be covered for its occluder to be reported, 0 … 1."""


class Hidden(NamedTuple):
    """Detection probabilities of J targets, and their occluders."""

    detection_probabilities: ndarray
    """(J,), p_D of each target."""
    hidden_by: ndarray
    """(J,), the label of the strongest occluder, -1 for none."""


@kernel
def expected_boxes(
    states: ndarray,
    half_height: float,
    half_width: float,
    size: int,
    camera: Calibration,
) -> UprightBoxes:
    """Predict the box of each upright target in a camera, and its derivative.

    It spans the projected axis from head to foot, whichever is above: a camera may hang upside
    down. In an image that is turned by about a quarter the axis is horizontal, and the target's
    width extends beyond its ends: then the box spans that.

    Args:
        states: (J, d), position first, world metres.
        half_height: Half height of the target, metres.
        half_width: Half width of the target, metres.
        size: Number of measured components of a box: 2 for its centre, 3 for horizontal centre,
            top and bottom, 4 for the width as well.
        camera: Image size, lens and pose of the camera.
    """
    rotation, translation = camera.rotation, camera.translation
    count, dimension = states.shape
    points = np.empty((3 * count, 3))
    for j in range(count):
        for part in range(3):
            for axis in range(3):
                points[3 * j + part, axis] = states[j, axis]
        points[3 * j + 1, 2] -= half_height
        points[3 * j + 2, 2] += half_height
    drawn = project_points(points, camera, True)
    pixels, slopes, ahead = drawn.pixels, drawn.jacobians, drawn.valid
    values = np.zeros((count, size))
    jacobians = np.zeros((count, size, dimension))
    boxes = np.zeros((count, 4))
    depths = np.empty(count)
    valid = np.zeros(count, dtype=np.bool_)
    share = half_width / half_height
    last = camera.image_size[1] - 1.0
    for j in range(count):
        total = 0.0
        for a in range(3):
            along = translation[a]
            for b in range(3):
                along += rotation[a, b] * states[j, b]
            total += along * along
        depths[j] = math.sqrt(total)
        middle, foot, head = 3 * j, 3 * j + 1, 3 * j + 2
        if not (ahead[middle] and ahead[foot] and ahead[head]):
            continue
        valid[j] = True
        across = (pixels[head, 0] + pixels[foot, 0]) / 2.0
        upper, lower = head, foot
        if pixels[head, 1] > pixels[foot, 1]:
            upper, lower = foot, head
        top, bottom = pixels[upper, 1], pixels[lower, 1]
        width = (bottom - top) * share
        reach = abs(pixels[head, 0] - pixels[foot, 0])
        sideways = reach * share > bottom - top
        if sideways:
            along = (top + bottom) / 2.0
            top, bottom = along - reach * share / 2.0, along + reach * share / 2.0
            width = reach
        boxes[j, 0], boxes[j, 1] = across - width / 2.0, top
        boxes[j, 2], boxes[j, 3] = across + width / 2.0, bottom
        if size == 2:
            for row in range(2):
                values[j, row] = pixels[middle, row]
                for a in range(3):
                    jacobians[j, row, a] = slopes[middle, row, a]
            continue
        # a box ends at the image's edge, and a clipped edge has no information about depth
        values[j, 0] = across
        values[j, 1] = min(max(top, 0.0), last)
        values[j, 2] = min(max(bottom, 0.0), last)
        for a in range(3):
            jacobians[j, 0, a] = (slopes[head, 0, a] + slopes[foot, 0, a]) / 2.0
            rise, fall = slopes[upper, 1, a], slopes[lower, 1, a]
            if sideways:
                sign = share if pixels[head, 0] > pixels[foot, 0] else -share
                grown = sign * (slopes[head, 0, a] - slopes[foot, 0, a]) / 2.0
                drift = (rise + fall) / 2.0
                rise, fall = drift - grown, drift + grown
            if values[j, 1] == top:
                jacobians[j, 1, a] = rise
            if values[j, 2] == bottom:
                jacobians[j, 2, a] = fall
        if size == 4:
            values[j, 3] = width
            for a in range(3):
                if sideways:
                    sign = 1.0 if pixels[head, 0] > pixels[foot, 0] else -1.0
                    jacobians[j, 3, a] = sign * (slopes[head, 0, a] - slopes[foot, 0, a])
                else:
                    jacobians[j, 3, a] = share * (slopes[lower, 1, a] - slopes[upper, 1, a])
    return UprightBoxes(values, jacobians, boxes, depths, valid)


@kernel
def body_shifts(states: ndarray, half_height: float, radius: float, camera: Calibration) -> ndarray:
    """Compute how far the bounds of a body in the image are from those of its axis.

    The rims of an upright cylinder around the axis are circles at its ends. To first order the
    support function of such a circle is ρ |∂h/∂(x, y)|: by that much the box begins before, and
    ends after, the projected end of the axis. If a body is widest elsewhere, the horizontal centre
    is that of the axis at that level.

    Args:
        states: (J, d), position first, world metres.
        half_height: Half height of the target, metres.
        radius: ρ, of the cylinder, metres.
        camera: Image size, lens and pose of the camera.

    Returns:
        (J, 4), pixels: shifts of horizontal centre, top and bottom by the rims, and that of the
        horizontal centre from the middle of the axis to its head; 0 behind the lens.
    """
    count = len(states)
    points = np.empty((2 * count, 3))
    for j in range(count):
        for end in range(2):
            for axis in range(3):
                points[2 * j + end, axis] = states[j, axis]
        points[2 * j, 2] -= half_height
        points[2 * j + 1, 2] += half_height
    drawn = project_points(points, camera, True)
    shifts = np.zeros((count, 4))
    for j in range(count):
        foot, head = 2 * j, 2 * j + 1
        if not (drawn.valid[foot] and drawn.valid[head]):
            continue
        left, right, top, bottom = np.inf, -np.inf, np.inf, -np.inf
        for end in range(foot, head + 1):
            x, y = drawn.pixels[end, 0], drawn.pixels[end, 1]
            across = radius * math.hypot(drawn.jacobians[end, 0, 0], drawn.jacobians[end, 0, 1])
            along = radius * math.hypot(drawn.jacobians[end, 1, 0], drawn.jacobians[end, 1, 1])
            left, right = min(left, x - across), max(right, x + across)
            top, bottom = min(top, y - along), max(bottom, y + along)
        one, other = drawn.pixels[foot], drawn.pixels[head]
        shifts[j, 0] = (left + right - one[0] - other[0]) / 2.0
        shifts[j, 1] = top - min(one[1], other[1])
        shifts[j, 2] = bottom - max(one[1], other[1])
        shifts[j, 3] = (other[0] - one[0]) / 2.0
    return shifts


@kernel
def inside_probability(
    boxes: ndarray,
    jacobians: ndarray,
    covariances: ndarray,
    valid: ndarray,
    image_size: ndarray,
    soft: bool,
) -> ndarray:
    """Compute the probability that the centre of each target lies inside the image.

    Args:
        boxes: (J, 4) left, top, right, bottom, pixels.
        jacobians: (J, m, d), of which the first row belongs to x and the second to y.
        covariances: (J, d, d), covariances of the states.
        valid: (J,), False where a target is not in front of the lens.
        image_size: (2,) width and height, pixels.
        soft: Whether the target's uncertainty and a pixel more are included; else it is 0 or 1.
    """
    count = len(boxes)
    dimension = covariances.shape[1]
    result = np.zeros(count)
    for j in range(count):
        if not valid[j]:
            continue
        product = 1.0
        for row in range(2):
            middle = (boxes[j, row] + boxes[j, row + 2]) / 2.0
            low, high = -0.5 - middle, image_size[row] - 0.5 - middle
            if not soft:
                product *= 1.0 if low <= 0.0 < high else 0.0
                continue
            variance = 0.0
            for a in range(dimension):
                for b in range(dimension):
                    variance += jacobians[j, row, a] * covariances[j, a, b] * jacobians[j, row, b]
            scale = (math.sqrt(max(variance, 0.0)) + 1.0) * math.sqrt(2.0)
            product *= (math.erfc(-high / scale) - math.erfc(-low / scale)) / 2.0
        result[j] = product
    return result


@kernel
def hide(
    detection_probabilities: ndarray,
    boxes: ndarray,
    depths: ndarray,
    means: ndarray,
    labels: ndarray,
    occluders: ndarray,
    weights: ndarray,
    occlusion: Occlusion,
) -> Hidden:
    """Lower each detection probability where other targets stand in front.

        p_j ← p_j Π_l (1 − ρ w_l a(j, l))
        a(j, l) = [l is nearer to the lens than j] · area(box_j ∩ box_l) / area(box_j)

    Args:
        detection_probabilities: (J,), p_j without occlusion.
        boxes: (J, 4) left, top, right, bottom, pixels.
        depths: (J,) distances from the lens, metres.
        means: (J, d) states, position first, world metres.
        labels: (J,) labels of the components.
        occluders: (L,), indices of the components that may occlude others.
        weights: (L,), their existence; values above 1 count as 1.
        occlusion: Parameters of the occlusion.
    """
    near, strength = occlusion.near, occlusion.strength
    count = len(detection_probabilities)
    result = detection_probabilities.copy()
    hidden_by = np.full(count, -1, dtype=np.int64)
    for j in range(count):
        area = max((boxes[j, 2] - boxes[j, 0]) * (boxes[j, 3] - boxes[j, 1]), 1e-9)
        strongest = occlusion.reporting_share
        for k in range(len(occluders)):
            other = occluders[k]
            if labels[other] == labels[j] or not depths[other] < depths[j]:
                continue
            distance = 0.0
            for a in range(3):
                distance += (means[j, a] - means[other, a]) ** 2
            if distance <= near * near:
                continue
            across = min(boxes[j, 2], boxes[other, 2]) - max(boxes[j, 0], boxes[other, 0])
            down = min(boxes[j, 3], boxes[other, 3]) - max(boxes[j, 1], boxes[other, 1])
            if across <= 0.0 or down <= 0.0:
                continue
            effect = min(weights[k], 1.0) * across * down / area
            result[j] *= max(1.0 - strength * effect, 0.0)
            if effect > strongest:
                strongest = effect
                hidden_by[j] = labels[other]
    return Hidden(result, hidden_by)


@kernel
def alone(boxes: ndarray, starts: ndarray) -> ndarray:
    """Whether each of a camera's boxes overlaps no other box of its step.

    Args:
        boxes: (B, 4) centre and half sizes, pixels.
        starts: (T + 1,), index of each step's first box, and B.
    """
    result = np.ones(len(boxes), dtype=np.bool_)
    for step in range(len(starts) - 1):
        for i in range(starts[step], starts[step + 1]):
            for j in range(starts[step], i):
                across = abs(boxes[i, 0] - boxes[j, 0]) < boxes[i, 2] + boxes[j, 2]
                down = abs(boxes[i, 1] - boxes[j, 1]) < boxes[i, 3] + boxes[j, 3]
                if across and down:
                    result[i] = False
                    result[j] = False
    return result


@kernel
def covered(boxes: ndarray, starts: ndarray) -> ndarray:
    """The largest share of each of a camera's boxes that another box of its step covers, 0 … 1.

    Args:
        boxes: (B, 4) centre and half sizes, pixels.
        starts: (T + 1,), index of each step's first box, and B.
    """
    result = np.zeros(len(boxes))
    for step in range(len(starts) - 1):
        for i in range(starts[step], starts[step + 1]):
            for j in range(starts[step], starts[step + 1]):
                if i == j:
                    continue
                share = 1.0
                for axis in range(2):
                    low = max(
                        boxes[i, axis] - boxes[i, axis + 2], boxes[j, axis] - boxes[j, axis + 2]
                    )
                    high = min(
                        boxes[i, axis] + boxes[i, axis + 2], boxes[j, axis] + boxes[j, axis + 2]
                    )
                    share *= max(high - low, 0.0) / max(2.0 * boxes[i, axis + 2], 1e-9)
                result[i] = max(result[i], min(share, 1.0))
    return result
