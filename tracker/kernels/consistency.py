"""Densities of one camera's boxes given another camera's boxes, compiled.

The boxes are of the same moments, or slid in time against predictions from the other camera.
"""

from __future__ import annotations

import math

import numpy as np
from numpy import ndarray

from tracker.kernels.compilation import compiled_later


@compiled_later
def density_ratios(
    feet: ndarray,
    heads: ndarray,
    whole: ndarray,
    starts: ndarray,
    centre: ndarray,
    seen: ndarray,
    background: ndarray,
    seen_starts: ndarray,
    rotation: ndarray,
    seen_centre: ndarray,
    scene: ndarray,
    sigma: float,
    height_sigma: float,
) -> ndarray:
    """Compute how much likelier each box of camera b is by the boxes of camera a than by itself.

    The foot of box i of camera a lies along its ray d at the distance s = arg min |h × (s d + r)|
    with the deviation s √(σ_H² + 2 σ²), and by the floor at s' = (f − n·c) / n·d with the deviation
    √(τ² + σ² H²) / |n·d|; both are combined by their information unless they differ by three
    deviations. In camera b this is a box μ_i, with the middle's place across, the foot's along and
    the head's along the vertical, and the covariance S_i = v J Jᵀ + η² diag(σ², σ², σ² + σ_H²/4),
    and the result of a box z is

        (1 / N_a) Σ_i N(z; μ_i, S_i) / p_b(z)

    Args:
        feet: (N, 3), d, unit directions to the feet of camera a's boxes, world axes.
        heads: (N, 3), h, unit directions to their heads.
        whole: (N,), whether neither end of the box is cut off.
        starts: (M + 1,), index of the first box of camera a of each of M moments, and N.
        centre: (3,), c, position of camera a.
        seen: (D, 4), x and y of foot and head of camera b's boxes on its image plane at distance 1.
        background: (D,), log p_b(z), NaN for a box that is not compared.
        seen_starts: (M + 1,), index of the first box of camera b of each moment, and D.
        rotation: (3, 3), R of camera b.
        seen_centre: (3,), position of camera b.
        scene: (8,), the rise r, the normal n, f and τ.
        sigma: σ, deviation of a box's ends in its heights.
        height_sigma: σ_H, deviation of people's heights in the common height.

    Returns:
        (D,), the ratio; NaN where nothing is compared.
    """
    result = np.full(len(seen), np.nan)
    rise, normal = scene[:3], scene[3:6]
    floor, scatter = scene[6], scene[7]
    height = math.sqrt(rise[0] ** 2 + rise[1] ** 2 + rise[2] ** 2)
    floor_sd = math.sqrt(scatter**2 + (sigma * height) ** 2)
    above = floor - (normal[0] * centre[0] + normal[1] * centre[1] + normal[2] * centre[2])
    size_share = math.sqrt(height_sigma**2 + 2.0 * sigma**2)
    base = centre - seen_centre
    for m in range(len(starts) - 1):
        count = starts[m + 1] - starts[m]
        if count == 0 or seen_starts[m] == seen_starts[m + 1]:
            continue
        for z in range(seen_starts[m], seen_starts[m + 1]):
            if not math.isnan(background[z]):
                result[z] = 0.0
        for i in range(starts[m], starts[m + 1]):
            if not whole[i]:
                continue
            dx, dy, dz = feet[i, 0], feet[i, 1], feet[i, 2]
            hx, hy, hz = heads[i, 0], heads[i, 1], heads[i, 2]
            ax, ay, az = hy * dz - hz * dy, hz * dx - hx * dz, hx * dy - hy * dx
            bx = hy * rise[2] - hz * rise[1]
            by = hz * rise[0] - hx * rise[2]
            bz = hx * rise[1] - hy * rise[0]
            square = ax * ax + ay * ay + az * az
            if square < 1e-12:
                continue
            s = -(ax * bx + ay * by + az * bz) / square
            if s <= 0.0:
                continue
            variance = (s * size_share) ** 2
            slope = normal[0] * dx + normal[1] * dy + normal[2] * dz
            if abs(slope) > 1e-3:
                other = above / slope
                other_variance = (floor_sd / slope) ** 2
                if (s - other) ** 2 < 9.0 * (variance + other_variance):
                    total = variance + other_variance
                    s = (s * other_variance + other * variance) / total
                    variance = variance * other_variance / total
            fx, fy, fz = base[0] + s * dx, base[1] + s * dy, base[2] + s * dz
            gx, gy, gz = fx + rise[0], fy + rise[1], fz + rise[2]
            foot_z = rotation[2, 0] * fx + rotation[2, 1] * fy + rotation[2, 2] * fz
            head_z = rotation[2, 0] * gx + rotation[2, 1] * gy + rotation[2, 2] * gz
            if foot_z < 0.02 * s or head_z < 0.02 * s:
                continue
            foot_x = (rotation[0, 0] * fx + rotation[0, 1] * fy + rotation[0, 2] * fz) / foot_z
            foot_y = (rotation[1, 0] * fx + rotation[1, 1] * fy + rotation[1, 2] * fz) / foot_z
            head_x = (rotation[0, 0] * gx + rotation[0, 1] * gy + rotation[0, 2] * gz) / head_z
            head_y = (rotation[1, 0] * gx + rotation[1, 1] * gy + rotation[1, 2] * gz) / head_z
            way_x = rotation[0, 0] * dx + rotation[0, 1] * dy + rotation[0, 2] * dz
            way_y = rotation[1, 0] * dx + rotation[1, 1] * dy + rotation[1, 2] * dz
            way_z = rotation[2, 0] * dx + rotation[2, 1] * dy + rotation[2, 2] * dz
            along_x, along_y = head_x - foot_x, head_y - foot_y
            eta = math.sqrt(along_x**2 + along_y**2)
            if eta < 1e-9:
                continue
            along_x, along_y = along_x / eta, along_y / eta
            foot_jx, foot_jy = (way_x - foot_x * way_z) / foot_z, (way_y - foot_y * way_z) / foot_z
            head_jx, head_jy = (way_x - head_x * way_z) / head_z, (way_y - head_y * way_z) / head_z
            j0 = 0.5 * ((foot_jy + head_jy) * along_x - (foot_jx + head_jx) * along_y)
            j1 = foot_jx * along_x + foot_jy * along_y
            j2 = head_jx * along_x + head_jy * along_y
            p01 = 1.0 / (eta * sigma) ** 2
            p2 = 1.0 / (eta**2 * (sigma**2 + 0.25 * height_sigma**2))
            growth = 1.0 + variance * (p01 * (j0 * j0 + j1 * j1) + p2 * j2 * j2)
            log_scale = 0.5 * math.log(p01 * p01 * p2 / growth) - 2.756815599614018
            for z in range(seen_starts[m], seen_starts[m + 1]):
                if math.isnan(background[z]):
                    continue
                ex, ey = seen[z, 0] - foot_x, seen[z, 1] - foot_y
                ux, uy = seen[z, 2] - head_x, seen[z, 3] - head_y
                r0 = 0.5 * ((ey + uy) * along_x - (ex + ux) * along_y)
                r1 = ex * along_x + ey * along_y
                r2 = ux * along_x + uy * along_y
                length = p01 * (r0 * r0 + r1 * r1) + p2 * r2 * r2
                on = p01 * (j0 * r0 + j1 * r1) + p2 * j2 * r2
                distance = length - variance * on * on / growth
                if distance < 60.0:
                    result[z] += math.exp(log_scale - 0.5 * distance - background[z]) / count
    return result


@compiled_later
def best_share(ratios: ndarray) -> float:
    """Find the q in 0 … 0.999 that maximises Σ log(1 − q + q ρ), a concave function.

    Args:
        ratios: (D,), ρ >= 0; NaN is left out.

    Returns:
        q, zero where the ratios explain nothing.
    """
    low, high = 0.0, 0.999
    for step in range(30):
        q = 0.0 if step == 0 else 0.5 * (low + high)
        slope = 0.0
        for ratio in ratios:
            if not math.isnan(ratio):
                slope += (ratio - 1.0) / (1.0 - q + q * ratio)
        if step == 0:
            if slope <= 0.0:
                return 0.0
        elif slope > 0.0:
            low = q
        else:
            high = q
    return 0.5 * (low + high)


@compiled_later
def pair_evidence(
    feet: ndarray,
    heads: ndarray,
    whole: ndarray,
    seen: ndarray,
    background: ndarray,
    starts: ndarray,
    rotations: ndarray,
    centres: ndarray,
    compared: ndarray,
    scene: ndarray,
    sigma: float,
    height_sigma: float,
) -> tuple[ndarray, ndarray]:
    """Compute max_q Σ_z log(1 − q + q ρ_z) of the boxes of each camera given those of another.

    Args:
        feet: (N, 3), unit directions to the feet of the boxes of all C cameras, world axes.
        heads: (N, 3), unit directions to their heads.
        whole: (N,), whether neither end of the box is cut off.
        seen: (N, 4), x and y of foot and head on the camera's image plane at distance 1.
        background: (N,), log p_b(z), NaN for a box that is not compared.
        starts: (C, M + 1), index of the first box of each camera and moment.
        rotations: (C, 3, 3), R of each camera.
        centres: (C, 3), position of each camera.
        compared: (C, C), whether the boxes of camera b are compared with those of camera a.
        scene: (8,), the rise r, the normal n, f and τ.
        sigma: σ, deviation of a box's ends in its heights.
        height_sigma: σ_H, deviation of people's heights in the common height.

    Returns:
        (C, C, M), nats by a, b and moment; and (C, C), q.
    """
    cameras, moments = len(starts), starts.shape[1] - 1
    nats = np.zeros((cameras, cameras, moments))
    shares = np.zeros((cameras, cameras))
    for a in range(cameras):
        begin, end = starts[a, 0], starts[a, moments]
        for b in range(cameras):
            if not compared[a, b]:
                continue
            low, high = starts[b, 0], starts[b, moments]
            ratios = density_ratios(
                feet[begin:end], heads[begin:end], whole[begin:end], starts[a] - begin, centres[a],
                seen[low:high], background[low:high], starts[b] - low, rotations[b], centres[b],
                scene, sigma, height_sigma,
            )  # fmt: skip
            q = best_share(ratios)
            shares[a, b] = q
            for m in range(moments):
                for z in range(starts[b, m] - low, starts[b, m + 1] - low):
                    if not math.isnan(ratios[z]):
                        nats[a, b, m] += math.log(1.0 - q + q * ratios[z])
    return nats, shares


@compiled_later
def meeting_heights(
    feet: ndarray,
    heads: ndarray,
    whole: ndarray,
    starts: ndarray,
    other_feet: ndarray,
    other_heads: ndarray,
    other_whole: ndarray,
    other_starts: ndarray,
    base: ndarray,
    axis: ndarray,
    log_heights: ndarray,
    largest_gap: float,
    spread: float,
) -> ndarray:
    """Count the boxes of camera a that meet one of camera b in people along an axis, by height.

    Heads and feet are triangulated by the midpoint method; a pair weighs
    (1 − (gap / largest gap)²) (1 − (lean / spread)²) with the gap between the rays and the lean of
    the rise in heights of the person, and each box of camera a counts by its best pair.

    Args:
        feet: (N, 3), unit directions to the feet of camera a's boxes, world axes.
        heads: (N, 3), unit directions to their heads.
        whole: (N,), whether neither end of the box is cut off.
        starts: (M + 1,), index of the first box of camera a of each of M moments, and N.
        other_feet: (D, 3), the same of camera b.
        other_heads: (D, 3), the same of camera b.
        other_whole: (D,), the same of camera b.
        other_starts: (M + 1,), the same of camera b.
        base: (3,), position of camera b relative to camera a.
        axis: (3,), unit vector along which people stand.
        log_heights: (H,), logarithms of heights, evenly spaced, in the unit of ``base``.
        largest_gap: Largest distance of two rays, in heights of the person.
        spread: Largest distance of the rise from the axis, in heights.

    Returns:
        (H,), the sums of weights.
    """
    heights = len(log_heights)
    result = np.zeros(heights)
    best = np.zeros(heights)
    step = log_heights[1] - log_heights[0]
    ends = np.zeros((2, 3))
    for m in range(len(starts) - 1):
        for i in range(starts[m], starts[m + 1]):
            if not whole[i]:
                continue
            best[:] = 0.0
            for j in range(other_starts[m], other_starts[m + 1]):
                if not other_whole[j]:
                    continue
                gap = 0.0
                good = True
                for end in range(2):
                    one = feet[i] if end == 0 else heads[i]
                    other = other_feet[j] if end == 0 else other_heads[j]
                    cosine = one[0] * other[0] + one[1] * other[1] + one[2] * other[2]
                    sine = 1.0 - cosine * cosine
                    if sine < 0.0025:
                        good = False
                        break
                    on_one = one[0] * base[0] + one[1] * base[1] + one[2] * base[2]
                    on_other = other[0] * base[0] + other[1] * base[1] + other[2] * base[2]
                    s = (on_one - cosine * on_other) / sine
                    t = (cosine * on_one - on_other) / sine
                    if s <= 0.0 or t <= 0.0:
                        good = False
                        break
                    square = 0.0
                    for n in range(3):
                        first, second = s * one[n], base[n] + t * other[n]
                        ends[end, n] = 0.5 * (first + second)
                        square += (first - second) ** 2
                    gap = max(gap, square)
                if not good:
                    continue
                height, length = 0.0, 0.0
                for n in range(3):
                    height += (ends[1, n] - ends[0, n]) * axis[n]
                    length += (ends[1, n] - ends[0, n]) ** 2
                if height <= 0.0:
                    continue
                gap = gap / height**2 / largest_gap**2
                lean = (length / height**2 - 1.0) / spread**2
                if gap >= 1.0 or lean >= 1.0:
                    continue
                place = math.floor((math.log(height) - log_heights[0]) / step)
                if 0 <= place < heights:
                    best[place] = max(best[place], (1.0 - gap) * (1.0 - lean))
            for place in range(heights):
                result[place] += best[place]
    return result


def _slide(
    expected: ndarray,
    tangents: ndarray,
    starts: ndarray,
    steps: ndarray,
    boxes: ndarray,
    following: ndarray,
    box_starts: ndarray,
    offsets: ndarray,
    sigma: float,
    depth_sigma: float,
) -> tuple[ndarray, ndarray]:
    """Compute how well boxes fit their predictions, for every offset and step.

    A box z fits a predicted one z₀, whose depth is known up to a factor exp(λ) with the tangent
    g = dz₀/dλ, with r = (z − z₀) / height by

        exp(−m²/2),  m² = min over λ of |r − λ g / height|² / σ² + λ² / σ_λ²

    Args:
        expected: (N, 4), x and y of head and foot, pixels; NaN for no prediction.
        tangents: (N, 4), g, pixels.
        starts: (S + 1,), index of the first prediction of each of the S sampled steps, and N.
        steps: (S,), the steps.
        boxes: (D, 4), x and y of head and foot, pixels; NaN for a clipped box.
        following: (D,), index of the box of the same person one step later, -1 for none.
        box_starts: (F + 1,), index of the first box of each of F steps, and D.
        offsets: (O,) offsets, steps, also fractions: step k is compared with k + offset.
        sigma: σ, heights of a box.
        depth_sigma: σ_λ, standard deviation of the logarithm of the depth.

    Returns:
        (O, S), the sum of the best fits, and the number of predictions at steps with a frame.
    """
    frames = len(box_starts) - 1
    fits = np.zeros((len(offsets), len(steps)))
    counts = np.zeros((len(offsets), len(steps)))
    most = 0
    for frame in range(frames):
        most = max(most, box_starts[frame + 1] - box_starts[frame])
    between = np.empty((most, 4))
    for o in range(len(offsets)):
        whole = math.floor(offsets[o] + 1e-9)
        part = offsets[o] - whole
        if part < 1e-6:
            part = 0.0
        for s in range(len(steps)):
            frame = steps[s] + whole
            if frame < 0 or frame >= frames or (part > 0.0 and frame + 1 >= frames):
                continue
            there = 0
            for d in range(box_starts[frame], box_starts[frame + 1]):
                if part == 0.0:
                    for axis in range(4):
                        between[there, axis] = boxes[d, axis]
                elif following[d] >= 0:
                    for axis in range(4):
                        between[there, axis] = (1.0 - part) * boxes[d, axis] + part * boxes[
                            following[d], axis
                        ]
                else:
                    continue
                if not math.isnan(between[there, 0]):
                    there += 1
            for n in range(starts[s], starts[s + 1]):
                if math.isnan(expected[n, 0]):
                    continue
                least = 18.0
                for d in range(there):
                    height = between[d, 3] - between[d, 1]
                    length, along, bend = 0.0, 0.0, 0.0
                    for axis in range(4):
                        r = (between[d, axis] - expected[n, axis]) / height
                        g = tangents[n, axis] / height
                        length += r * r
                        along += r * g
                        bend += g * g
                    precision = 1.0 / sigma**2
                    distance = precision * length - (precision * along) ** 2 / (
                        1.0 / depth_sigma**2 + precision * bend
                    )
                    least = min(least, distance)
                fits[o, s] += math.exp(-0.5 * least)
                counts[o, s] += 1.0
    return fits, counts


slide = compiled_later(_slide)
