"""How likely a camera is to detect each target: the picture's edge, and people behind people."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.fusion.target_model import ExpectedBoxes
from tracker.geometry.camera import Camera
from tracker.kernels import boxes as box_kernels
from tracker.kernels.boxes import Occlusion

WORTH_TELLING = 0.2
"""Share of a target's box that must be covered for its occluder to be named in the result. It
changes what is reported, not what is tracked."""


@dataclass(frozen=True, slots=True, eq=False)
class Visibility:
    """Detection probabilities of one camera for J targets, and what lowers them."""

    detection_probabilities: Float[ndarray, " J"]
    hidden_by: Int[ndarray, " J"]
    """Label of the occluder that covers most of each target, -1 where nobody does."""


def inside_probability(
    camera: Camera,
    expected: ExpectedBoxes,
    covariances: Float[ndarray, "J d d"],
    *,
    soft: bool = True,
) -> Float[ndarray, " J"]:
    """Probability that the middle of each target falls inside the picture.

    The predicted position is taken as Gaussian in the picture, so the value falls
    smoothly towards the edge, over the width of its own uncertainty; it is 0 where
    head or foot is behind the lens.

    Args:
        camera: Its picture's size counts.
        expected: The boxes that the targets should give there.
        covariances: Of their states.
        soft: False for the published edge: 1 inside, 0 outside.
    """
    inside: ndarray = box_kernels.inside_probability(
        expected.boxes,
        expected.jacobians,
        np.ascontiguousarray(covariances),
        expected.valid,
        camera.calibration.image_size,
        soft,
    )
    return inside


def visibility(
    detection_probabilities: Float[ndarray, " J"],
    expected: ExpectedBoxes,
    mixture: GaussianMixture,
    *,
    occluders: Int[ndarray, " L"],
    weights: Float[ndarray, " L"],
    strength: float,
    near: float,
) -> Visibility:
    """Lower each p_D where other people stand in front.

        p_j ← p_j Π_l (1 − ρ w_l a(j, l))
        a(j, l) = [l is nearer to the lens than j] · area(box_j ∩ box_l) / area(box_j)

    over the occluders that are somebody else: the chance that nobody hides j, for
    independent occluders that exist with probability w_l.

    Args:
        detection_probabilities: p_j without occlusion.
        expected: The boxes that the components should give in this camera.
        mixture: The components, with their labels.
        occluders: Indices of the components that may hide others: sure ones, one a person.
        weights: Their existence; at most 1 counts.
        strength: ρ, 0 for no occlusion at all, 1 where a covered person is never seen.
        near: Metres within which an occluder may be the target's duplicate; a target must
            not hide behind itself.
    """
    if strength == 0.0 or not len(occluders):
        nobody = np.full(len(detection_probabilities), -1, dtype=np.int64)
        return Visibility(detection_probabilities, nobody)
    found = box_kernels.hide(
        detection_probabilities,
        expected.boxes,
        expected.depths,
        mixture.means,
        mixture.labels,
        occluders,
        weights,
        Occlusion(near, strength, WORTH_TELLING),
    )
    return Visibility(found.detection_probabilities, found.hidden_by)
