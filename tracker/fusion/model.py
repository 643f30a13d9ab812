"""The models that all fusion methods share: motion, birth, measurement, visibility, clutter."""

from __future__ import annotations

from collections.abc import Sequence as Many

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.filters import association, gaussian_mixture, models
from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.fusion import missing_frames, target_model
from tracker.fusion.measurement_births import BirthModel, Evidence, MeasurementBirths, Newborns
from tracker.fusion.missing_frames import Recent, StepEvidence
from tracker.fusion.target_model import HeightBounds, TargetModel
from tracker.kernels import linear_algebra
from tracker.kernels.boxes import Hidden
from tracker.kernels.labelled import CameraBoxes, CameraRule
from tracker.kernels.measurement import ExpectedBoxes
from tracker.parameters.groups.fusion import FusionParams
from tracker.sequences.sequence import Sequence
from tracker.single_view.protocol import ViewResult

CONFIRMED = 0.5
"""Weight above which a component is a confirmed track, which may occlude others: its target is
likelier there than not."""


class FusionModel:
    """The models of one sequence: its room, its cameras and its targets, with the parameters."""

    def __init__(self, sequence: Sequence, parameters: FusionParams) -> None:
        """Make the models of one sequence.

        Args:
            sequence: The cameras, the room, the size of a target and the time of a step.
            parameters: The parameters of the fusion.
        """
        p = self.parameters = parameters
        self.room = sequence.room
        self.cameras = sequence.cameras
        self.step_time = sequence.step_time
        self.target = TargetModel(
            sequence.target_half_extents, p.measurement, p.update, p.posture_share, p
        )
        self.motion = models.Motion.of(p, sequence.step_time)
        self.births = self.motion.at_rest(
            models.entrance_births(sequence.room, p.birth_rate * sequence.step_time)
        )
        """γ: one component for each entrance, with the weight of one step."""
        self.clutter = np.array(
            [
                p.clutter_rate / models.measurement_volume(camera, sequence.room, self.target.size)
                for camera in self.cameras
            ]
        )
        """κ of each camera, per unit of the measurement space."""
        self.gate = gaussian_mixture.gate_distance(p.gate_probability, self.target.size)
        """Largest squared Mahalanobis distance of an innovation."""
        self.recovery_gate = gaussian_mixture.gate_distance(p.memory_gate_probability, 3)
        """Squared Mahalanobis distance within which a new track may take over a lost label."""
        self.place_gate = gaussian_mixture.gate_distance(p.gate_probability, 3)
        """Squared Mahalanobis distance within which a place constraint belongs to a target."""
        self.near = p.duplicate_distance * 2.0 * float(np.mean(sequence.target_half_extents[:2]))
        """Distance within which two tracks may be duplicates of one person, metres."""
        self.height = 2.0 * float(sequence.target_half_extents[2])
        """Height of a target, metres: from this vertical distance on, two targets are one above the
        other and no duplicates."""
        share = self.target.posture_share
        self.heights = (
            HeightBounds.of(sequence.room, p.posture_height * self.target.half_height, share)
            if share
            else None
        )
        """Where a target's centre can be between floor and ceiling; None where no posture but the
        upright one is assumed."""
        margin = p.followed_margin
        self.tracked_volume = (self.room.minimum - margin, self.room.maximum + margin)
        """Minimum and maximum of the volume in which targets are tracked, world metres."""
        self._newborns = MeasurementBirths(
            self.cameras,
            sequence.room,
            self.target,
            BirthModel(
                birth_rate=p.birth_rate * sequence.step_time,
                detection_probability=p.detection_probability,
                clutter=self.clutter,
                gate=self.gate,
                margin=p.followed_margin,
                largest_gap=2.0 * float(np.max(sequence.target_half_extents)),
            ),
        )

    def expected(self, index: int, mixture: GaussianMixture) -> ExpectedBoxes:
        """Predict the box of each of J components in the camera ``index``."""
        return self.target.expected(self.cameras[index], mixture.means, mixture.covariances)

    def detection_probabilities(
        self, index: int, expected: ExpectedBoxes, mixture: GaussianMixture
    ) -> Float[ndarray, " J"]:
        """Compute p_D of each of J components in one camera, without occlusion.

        Args:
            index: Index of the camera.
            expected: The predicted boxes of the components in that camera.
            mixture: J components.
        """
        return self.parameters.detection_probability * target_model.inside_probability(
            self.cameras[index],
            expected,
            mixture.covariances,
            soft=self.parameters.edge == "soft",
        )

    def visible(
        self,
        index: int,
        expected: ExpectedBoxes,
        mixture: GaussianMixture,
        occluders: Float[ndarray, " J"],
    ) -> Hidden:
        """Compute p_D of every component in one camera, with occlusion.

        Args:
            index: Index of the camera.
            expected: The predicted boxes of the components in that camera.
            mixture: J components.
            occluders: Weight of each component that may occlude others, else 0.
        """
        hiding = np.flatnonzero(occluders)
        return target_model.visibility(
            self.detection_probabilities(index, expected, mixture),
            expected,
            mixture,
            occluders=hiding,
            weights=occluders[hiding],
            strength=self.parameters.occlusion,
            near=self.near,
        )

    def camera_rule(self, reporting_threshold: float) -> CameraRule:
        """Make the parameters of a camera's update, in the form that the kernels take.

        Args:
            reporting_threshold: Association probability from which a pair is reported, 0 … 1.
        """
        p = self.parameters
        return CameraRule(
            gate=self.gate,
            soft=p.edge == "soft",
            detection_probability=p.detection_probability,
            confirmed=CONFIRMED,
            near=self.near,
            strength=p.occlusion,
            reporting_share=target_model.REPORTING_SHARE,
            tolerance=association.TOLERANCE,
            iterations=association.ITERATIONS,
            reporting_threshold=reporting_threshold,
        )

    def newborns(self, evidence: Evidence) -> tuple[GaussianMixture, Newborns] | None:
        """Propose births where unexplained boxes of several cameras agree on a place.

        Returns:
            Components without labels, and the boxes behind each; None for no birth.
        """
        found = self._newborns.propose(evidence)
        return None if found is None else self._at_rest(found)

    def newborns_and_recent(
        self,
        evidence: Evidence,
        boxes: Float[ndarray, "B 4"],
        views: Many[ViewResult],
        recent: Recent,
    ) -> tuple[tuple[GaussianMixture, Newborns] | None, Recent]:
        """Propose births as :meth:`newborns` does, also from recent frames of asynchronous cameras.

        Args:
            evidence: The B boxes of this step and how far tracks explain them.
            boxes: centre_x, centre_y, half_width, half_height of these boxes, pixels.
            views: The result of each camera, which says whether it has a frame.
            recent: The evidence of the last steps; empty at the start.

        Returns:
            Components and the boxes behind them, or None for no birth; and the recent evidence
            for the next step.
        """
        blind = np.array([view.blind for view in views])
        now = StepEvidence(evidence, boxes, blind)
        later = missing_frames.remember(recent, now, self.step_time)
        if not blind.any():
            return self.newborns(evidence), later
        joined = missing_frames.with_recent(now, recent, self.step_time, self.target.half_height)
        proposed = self._newborns.propose(joined)
        if proposed is None:
            return None, later
        found = missing_frames.with_present_boxes(proposed, blind)
        return (self._at_rest(found) if len(found.existences) else None), later

    def _at_rest(self, found: Newborns) -> tuple[GaussianMixture, Newborns]:
        """Make components without labels of newborn targets, at rest, and return both."""
        unlabelled = np.zeros(len(found.existences), dtype=np.int64)
        born = GaussianMixture(found.existences, found.positions, found.covariances, unlabelled)
        return self.motion.at_rest(born), found

    def inside_tracked_volume(self, mixture: GaussianMixture) -> Int[ndarray, " K"]:
        """Return the indices of the components whose means lie in the tracked volume."""
        inside: ndarray = linear_algebra.inside_bounds(mixture.means, *self.tracked_volume)
        return inside

    def duplicates(
        self,
        means: Float[ndarray, "n d"],
        weights: Float[ndarray, " n"],
        labels: Int[ndarray, " n"],
        sources: Int[ndarray, "C n"],
    ) -> Bool[ndarray, " n"]:
        """Find which of n tracks are duplicates of a heavier or older one at the same place.

        Two tracks nearer than :attr:`near` are one person, unless some camera has a box for each.
        Two that are nearer than half of it on the floor, and not one above the other, are one
        person in any case: a detector may give two boxes for a person, and two people cannot stand
        in one place. Of two confirmed tracks the older label remains; an unconfirmed track never
        replaces a confirmed one.

        Args:
            means: State of each track, position first, world metres.
            weights: Existence of each track.
            labels: Label of each track; older ones are smaller.
            sources: Index of the box of each track in each camera, -1 for none.
        """
        found: ndarray = linear_algebra.duplicates(
            means, weights, labels, np.ascontiguousarray(sources), self.near, self.height,
            CONFIRMED,
        )  # fmt: skip
        return found


def all_boxes(views: Many[ViewResult]) -> CameraBoxes:
    """Concatenate the boxes of all cameras, with their standard deviations and clutter factors."""
    starts = [0]
    for view in views:
        starts.append(starts[-1] + len(view.boxes))
    return CameraBoxes(
        np.concatenate([view.boxes for view in views], dtype=float),
        np.concatenate([view.sigmas for view in views], dtype=float),
        np.array(starts),
        np.concatenate([view.clutter_factors for view in views]),
        np.ones((0, starts[-1])),
    )
