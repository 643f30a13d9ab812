"""How likely a camera is to detect each target: the picture's edge, and people behind people."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.special import ndtr

from tracker.camera import Camera
from tracker.fusion.target_model import ExpectedBoxes

_WORTH_TELLING = 0.2
"""Share of a target's box that must be covered for its occluder to be named."""


@dataclass(frozen=True, slots=True, eq=False)
class Visibility:
    """Detection probabilities of one camera for J targets, and what lowers them."""

    detection_probabilities: Float[ndarray, " J"]
    hidden_by: Int[ndarray, " J"]
    """Label of the occluder that covers most of each target, -1 where nobody does."""


def inside_probability(
    camera: Camera, expected: ExpectedBoxes, covariances: Float[ndarray, "J d d"]
) -> Float[ndarray, " J"]:
    """Probability that the middle of each target falls inside the picture.

    The predicted position is taken as Gaussian in the picture, so the value falls
    smoothly towards the edge, over the width of its own uncertainty; it is 0 where
    head or foot is behind the lens.
    """
    boxes = expected.boxes
    middle = (boxes[:, :2] + boxes[:, 2:]) / 2.0
    slopes = expected.jacobians[:, :2]
    spread = np.sqrt(np.einsum("jma,jab,jmb->jm", slopes, covariances, slopes)) + 1.0
    size = np.array(camera.image_size, dtype=float)
    inside = ndtr((size - 0.5 - middle) / spread) - ndtr((-0.5 - middle) / spread)
    return np.asarray(np.where(expected.valid, inside.prod(axis=1), 0.0))


def covered_shares(expected: ExpectedBoxes, occluders: ExpectedBoxes) -> Float[ndarray, "J L"]:
    """Share of each target's box that each nearer occluder's box covers.

    a(j, l) = [l is nearer to the lens than j] · area(box_j ∩ box_l) / area(box_j)
    """
    a, b = expected.boxes[:, None, :], occluders.boxes[None, :, :]
    overlap = np.minimum(a[..., 2:], b[..., 2:]) - np.maximum(a[..., :2], b[..., :2])
    area = np.maximum((expected.boxes[:, 2:] - expected.boxes[:, :2]).prod(axis=1), 1e-9)
    nearer = occluders.depths[None, :] < expected.depths[:, None]
    shares = np.clip(overlap, 0.0, None).prod(axis=2) / area[:, None]
    return np.asarray(shares * (nearer & occluders.valid[None, :]))


def unhidden(detection_probabilities: Float[ndarray, " J"]) -> Visibility:
    """Nobody is hidden by anybody."""
    return Visibility(
        detection_probabilities, np.full(len(detection_probabilities), -1, dtype=np.int64)
    )


def behind_others(
    detection_probabilities: Float[ndarray, " J"],
    shares: Float[ndarray, "J L"],
    weights: Float[ndarray, " L"],
    others: Bool[ndarray, "J L"],
    labels: Int[ndarray, " L"],
    strength: float,
) -> Visibility:
    """Lower each p_D where other people stand in front.

        p_j ← p_j Π_l (1 − ρ · w_l · a(j, l))

    over the occluders that are somebody else: the chance that nobody hides j, for
    independent occluders that exist with probability w_l.

    Args:
        detection_probabilities: p_j without occlusion.
        shares: a(j, l) of :func:`covered_shares`.
        weights: Existence of each occluder; at most 1 counts.
        others: False where the occluder is the target itself, or so near that it may
            be its double: a target must not hide behind itself.
        labels: Of the occluders.
        strength: ρ, 0 for no occlusion at all, 1 where a covered person is never seen.
    """
    effect = np.where(others, shares * np.minimum(weights, 1.0), 0.0)
    free = np.clip(1.0 - strength * effect, 0.0, 1.0).prod(axis=1)
    strongest = effect.argmax(axis=1)
    hidden = effect[np.arange(len(effect)), strongest] > _WORTH_TELLING
    return Visibility(detection_probabilities * free, np.where(hidden, labels[strongest], -1))
