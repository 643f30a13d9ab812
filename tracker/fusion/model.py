"""The models that every fusion method shares: motion, birth, measurement, visibility, clutter."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.stats import chi2

from tracker import models
from tracker.fusion import visibility
from tracker.fusion.measurement_births import MeasurementBirths
from tracker.fusion.target_model import ExpectedBoxes, TargetModel
from tracker.fusion.visibility import Visibility
from tracker.gaussian_mixture import GaussianMixture
from tracker.parameters import FusionParams
from tracker.sequences.sequence import Sequence

CONFIRMED = 0.5
"""A component surer than this stands for a person: it may hide others."""

_STRAYED = 0.5
"""Metres beyond the room's margin at which a component is given up."""


class FusionModel:
    """A room, its cameras and its people, as the parameters describe them."""

    def __init__(self, sequence: Sequence, parameters: FusionParams) -> None:
        p = self.parameters = parameters
        self.room = sequence.room
        self.cameras = sequence.cameras
        self.target = TargetModel(sequence.target_half_extents, p.measurement)
        self.motion = models.Motion.of(p, sequence.step_time)
        self.births = self.motion.at_rest(
            models.entrance_births(sequence.room, p.birth_rate * sequence.step_time)
        )
        """γ: one component an entrance, with the weight of one step."""
        self.clutter = [
            p.clutter_rate / models.measurement_volume(camera, sequence.room, self.target.size)
            for camera in self.cameras
        ]
        """κ of each camera, per unit of the measurement space."""
        self.gate = float(chi2.ppf(p.gate_probability, df=self.target.size))
        """Squared Mahalanobis distance of the innovation."""
        self.near = p.duplicate_distance * 2.0 * float(np.mean(sequence.target_half_extents[:2]))
        """Metres within which two components may be one person."""
        self.newborns = MeasurementBirths(
            self.cameras,
            sequence.room,
            self.target,
            birth_rate=p.birth_rate * sequence.step_time,
            detection_probability=p.detection_probability,
            gate=self.gate,
            margin=p.room_margin,
            largest_gap=2.0 * float(np.max(sequence.target_half_extents)),
        )

    def visible(
        self,
        index: int,
        expected: ExpectedBoxes,
        mixture: GaussianMixture,
        occluders: Float[ndarray, " J"],
    ) -> Visibility:
        """p_D of every component in one camera.

        Args:
            index: Of the camera.
            expected: The boxes that the components should give there.
            mixture: The components.
            occluders: Weight of each component where it may hide others, else 0.
        """
        p, means = self.parameters, mixture.means[:, :3]
        inside = visibility.inside_probability(self.cameras[index], expected, mixture.covariances)
        hiding = np.flatnonzero(occluders > CONFIRMED)
        if p.occlusion == 0.0 or not len(hiding):
            return visibility.unhidden(p.detection_probability * inside)
        others = mixture.labels[:, None] != mixture.labels[None, hiding]
        distances = np.linalg.norm(means[:, None] - means[None, hiding], axis=2)
        return visibility.behind_others(
            p.detection_probability * inside,
            visibility.covered_shares(expected, expected.take(hiding)),
            occluders[hiding],
            others & (distances > self.near),
            mixture.labels[hiding],
            p.occlusion,
        )

    def stays(self, mixture: GaussianMixture) -> Int[ndarray, " K"]:
        """Indices of the components that have not strayed from the room."""
        margin = self.parameters.room_margin + _STRAYED
        return np.flatnonzero(self.room.contains(mixture.means[:, :3], margin))
