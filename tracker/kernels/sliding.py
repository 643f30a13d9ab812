"""Agreement of one camera's boxes, shifted in time, with predictions from another, compiled."""

from __future__ import annotations

import math

import numpy as np
from numpy import ndarray

from tracker.kernels.compilation import compiled_later


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
