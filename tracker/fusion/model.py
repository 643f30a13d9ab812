"""The models that every fusion method shares: motion, birth, measurement, visibility, clutter."""

from __future__ import annotations

from collections.abc import Sequence as Many

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.filters import association, gaussian_mixture, models
from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.fusion import missing_frames, visibility
from tracker.fusion.measurement_births import BirthModel, Evidence, MeasurementBirths, Newborns
from tracker.fusion.missing_frames import Glimpse, Recent
from tracker.fusion.target_model import ExpectedBoxes, TargetModel
from tracker.fusion.visibility import Visibility
from tracker.kernels import linear_algebra
from tracker.kernels.labelled.camera_update import CameraRule
from tracker.kernels.labelled.step import CameraBoxes
from tracker.parameters import FusionParams
from tracker.sequences.sequence import Sequence
from tracker.single_view.protocol import ViewResult

CONFIRMED = 0.5
"""A component surer than this stands for a person, who may hide others: he is there more likely
than not."""


class FusionModel:
    """A room, its cameras and its people, as the parameters describe them."""

    def __init__(self, sequence: Sequence, parameters: FusionParams) -> None:
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
        """γ: one component an entrance, with the weight of one step."""
        self.clutter = np.array(
            [
                p.clutter_rate / models.measurement_volume(camera, sequence.room, self.target.size)
                for camera in self.cameras
            ]
        )
        """κ of each camera, per unit of the measurement space."""
        self.gate = gaussian_mixture.gate_distance(p.gate_probability, self.target.size)
        """Squared Mahalanobis distance of the innovation."""
        self.memory_reach = gaussian_mixture.gate_distance(p.memory_gate_probability, 3)
        """Squared Mahalanobis distance within which a newcomer may be somebody lately lost."""
        self.gate_of_places = gaussian_mixture.gate_distance(p.gate_probability, 3)
        """Squared Mahalanobis distance within which a place that somebody names is a target's."""
        self.near = p.duplicate_distance * 2.0 * float(np.mean(sequence.target_half_extents[:2]))
        """Metres within which two components may be one person."""
        self.height = 2.0 * float(sequence.target_half_extents[2])
        """Metres from which one target is above another."""
        margin = p.followed_margin
        self.followed = (self.room.minimum - margin, self.room.maximum + margin)
        """The corners between which people are followed."""
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
        """The box that a camera should give of every component."""
        return self.target.expected(self.cameras[index], mixture.means, mixture.covariances)

    def detection_probabilities(
        self, index: int, expected: ExpectedBoxes, mixture: GaussianMixture
    ) -> Float[ndarray, " J"]:
        """p_D of every component in one camera where nobody hides anybody."""
        return self.parameters.detection_probability * visibility.inside_probability(
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
    ) -> Visibility:
        """p_D of every component in one camera, and who hides it.

        Args:
            index: Of the camera.
            expected: The boxes that the components should give there.
            mixture: The components.
            occluders: Weight of each component where it may hide others, else 0.
        """
        hiding = np.flatnonzero(occluders > CONFIRMED)
        return visibility.visibility(
            self.detection_probabilities(index, expected, mixture),
            expected,
            mixture,
            occluders=hiding,
            weights=occluders[hiding],
            strength=self.parameters.occlusion,
            near=self.near,
        )

    def camera_rule(self, least_told: float) -> CameraRule:
        """How one camera's boxes are shared among the components.

        Args:
            least_told: Association probability from which a pair is told.
        """
        p = self.parameters
        return CameraRule(
            gate=self.gate,
            soft=p.edge == "soft",
            detection_probability=p.detection_probability,
            confirmed=CONFIRMED,
            near=self.near,
            strength=p.occlusion,
            worth_telling=visibility.WORTH_TELLING,
            tolerance=association.TOLERANCE,
            iterations=association.ITERATIONS,
            least_told=least_told,
        )

    def newborns(self, evidence: Evidence) -> tuple[GaussianMixture, Newborns] | None:
        """Newcomers where unexplained boxes of several cameras agree: components without labels,
        and what says so; None for nobody."""
        found = self._newborns.propose(evidence)
        return None if found is None else self._at_rest(found)

    def newborns_and_recent(
        self,
        evidence: Evidence,
        boxes: Float[ndarray, "B 4"],
        views: Many[ViewResult],
        recent: Recent,
    ) -> tuple[tuple[GaussianMixture, Newborns] | None, Recent]:
        """As :meth:`newborns`, with what cameras that have no frame now left unexplained lately.

        Args:
            evidence: What the cameras leave unexplained.
            boxes: Camera after camera, centre and half sizes, pixels.
            views: Which cameras have a frame.
            recent: What was remembered at the end of the step before; empty at the start.
        """
        blind = np.array([view.blind for view in views])
        now = Glimpse(evidence, boxes, blind)
        later = missing_frames.remember(recent, now, self.step_time)
        if not blind.any():
            return self.newborns(evidence), later
        joined = missing_frames.with_recent(now, recent, self.step_time, self.target.half_height)
        proposed = self._newborns.propose(joined)
        if proposed is None:
            return None, later
        found = missing_frames.of_this_step(proposed, blind)
        return (self._at_rest(found) if len(found.existences) else None), later

    def _at_rest(self, found: Newborns) -> tuple[GaussianMixture, Newborns]:
        nameless = np.zeros(len(found.existences), dtype=np.int64)
        born = GaussianMixture(found.existences, found.positions, found.covariances, nameless)
        return self.motion.at_rest(born), found

    def stays(self, mixture: GaussianMixture) -> Int[ndarray, " K"]:
        """Indices of the components that have not strayed from the room."""
        inside: ndarray = linear_algebra.inside_bounds(mixture.means, *self.followed)
        return inside

    def duplicates(
        self,
        means: Float[ndarray, "n d"],
        weights: Float[ndarray, " n"],
        labels: Int[ndarray, " n"],
        sources: Int[ndarray, "C n"],
    ) -> Bool[ndarray, " n"]:
        """Which of n tracks are duplicates, which repeat a surer or older one at the same place.

        Two nearer than ``near`` are one person, unless some camera gave each a box of
        its own; who stand on the floor within half of it are one even so, for a detector may
        draw two boxes around one person, one higher than the other, and two people cannot
        stand in one place. Among sure ones
        the older label stays; an unsure one never displaces a sure one.
        """
        found: ndarray = linear_algebra.duplicates(
            means, weights, labels, np.ascontiguousarray(sources), self.near, self.height,
            CONFIRMED,
        )  # fmt: skip
        return found


def all_boxes(views: Many[ViewResult]) -> CameraBoxes:
    """The boxes of all cameras, one after another."""
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
