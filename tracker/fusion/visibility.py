"""Detection probability of each target in a camera: the edge of the image, and occlusion."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.geometry.camera import Camera
from tracker.kernels import boxes as box_kernels
from tracker.kernels.boxes import Hidden, Occlusion
from tracker.kernels.measurement import ExpectedBoxes

REPORTING_SHARE = 0.2
"""Share of a target's box that must be covered for its occluder to be reported. It has no effect
on the tracks."""


def inside_probability(
    camera: Camera,
    expected: ExpectedBoxes,
    covariances: Float[ndarray, "J d d"],
    *,
    soft: bool = True,
) -> Float[ndarray, " J"]:
    """Compute the probability that the centre of each target lies inside the image.

    The predicted position is taken as Gaussian in the image, so the value falls
    smoothly towards the edge, over the width of its own uncertainty and one pixel more;
    it is 0 where head or foot is behind the lens.

    Args:
        camera: The camera, whose image size is used.
        expected: The predicted boxes of J targets in that camera.
        covariances: Covariance of each target's state, metres and seconds.
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
) -> Hidden:
    """Lower each p_D where other targets stand in front.

        p_j ← p_j Π_l (1 − ρ w_l a(j, l))
        a(j, l) = [l is nearer to the lens than j] · area(box_j ∩ box_l) / area(box_j)

    where l runs over the occluders with another label than j. It is the probability that no
    occluder hides j, if occluders l exist independently with probability w_l.

    Args:
        detection_probabilities: p_j without occlusion, of J components.
        expected: The predicted boxes of the components in this camera.
        mixture: J components, with their labels.
        occluders: Indices of the components that may occlude others: confirmed ones, one a label.
        weights: Existence of each occluder; values above 1 count as 1.
        strength: ρ, 0 for no occlusion, 1 where a covered target is never detected.
        near: Distance within which an occluder may be a duplicate of the target, metres; a
            duplicate does not occlude.
    """
    if strength == 0.0 or not len(occluders):
        unoccluded = np.full(len(detection_probabilities), -1, dtype=np.int64)
        return Hidden(detection_probabilities, unoccluded)
    found: Hidden = box_kernels.hide(
        detection_probabilities,
        expected.boxes,
        expected.depths,
        mixture.means,
        mixture.labels,
        occluders,
        weights,
        Occlusion(near, strength, REPORTING_SHARE),
    )
    return found
