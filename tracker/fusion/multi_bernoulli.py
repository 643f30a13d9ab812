"""Fusion by the Poisson multi-Bernoulli filter: each track has existence, Gaussian and label.

[W15] J. L. Williams, "Marginal multi-Bernoulli filters: RFS derivation of MHT,
JIPDA, and association-based MeMBer", IEEE Transactions on Aerospace and
Electronic Systems 51(3), 2015: TOMB/P.
"""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Int
from numpy import ndarray

from tracker.filters import gaussian_mixture, models
from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.fusion import memory, missing_frames, reidentification
from tracker.fusion.constraint_update import apply_constraints
from tracker.fusion.measurement_births import Evidence, Newborns
from tracker.fusion.memory import Memory
from tracker.fusion.missing_frames import Recent
from tracker.fusion.model import CONFIRMED, FusionModel, all_boxes
from tracker.fusion.protocol import FusionResult, PlaceConstraints
from tracker.fusion.record import REPORTING_THRESHOLD, Record, sum_associations
from tracker.fusion.reidentification import IdentityBeliefs
from tracker.geometry.camera import stacked
from tracker.kernels import labelled as step_kernels
from tracker.kernels.kalman import Measurements
from tracker.kernels.labelled import KeepingRule, StepModel, Tracks
from tracker.kernels.lens import Calibrations
from tracker.sequences.sequence import Sequence
from tracker.single_view.protocol import ViewResult

if TYPE_CHECKING:
    from tracker.parameters.catalogue import RunParameters


@dataclass(frozen=True, slots=True, eq=False)
class MultiBernoulliState:
    """The posterior of a step and all that the next step needs of it."""

    tracks: GaussianMixture
    """The Bernoulli tracks: existence probability as weight, one component a label."""
    undetected: GaussianMixture
    """The Poisson intensity of targets that were never detected."""
    next_label: int
    """The first label that is free."""
    memory: Memory
    """The confirmed tracks and those lost a short while ago."""
    identities: IdentityBeliefs
    """Beliefs of the tracks over the people with templates."""
    recent: Recent = ()
    """Unexplained boxes of the last frames, for cameras that have none at a step."""


class MultiBernoulli:
    """Fusion by TOMB/P with belief propagation, camera after camera ([W15]).

    A detected target is a Bernoulli: an existence probability, one Gaussian and a
    label that does not change. Targets not yet detected are a Poisson intensity; a
    measurement that it explains begins a track, and so do unexplained boxes of
    several cameras that agree on a place.
    """

    def __init__(self, sequence: Sequence, parameters: RunParameters) -> None:
        """Prepare the filter for one sequence."""
        p, model = parameters.fusion, FusionModel(sequence, parameters.fusion)
        self._parameters, self._model = p, model
        motion, target = model.motion, model.target
        births = model.births
        if p.birth == "measurements":
            births = GaussianMixture.empty(motion.dimension)
        transform, products = target.transforms
        self._step_model = StepModel(
            transition=motion.transition,
            motion_noise=motion.noise[None],
            survival_probability=p.survival_probability,
            birth_weights=births.weights,
            birth_means=births.means,
            birth_covariances=births.covariances,
            transform=transform,
            products=products,
            sigma_factor=p.measurement_sigma,
            clutter=model.clutter,
            least_existence=p.pruning_threshold,
        )
        self._cameras = stacked(model.cameras)
        self._seen_by: dict[bytes, tuple[StepModel, Calibrations]] = {}
        """Model and cameras of a step, by the cameras that have a frame."""
        self._target = target.target(motion.dimension)
        self._camera_rule = model.camera_rule(REPORTING_THRESHOLD)
        low, high = model.tracked_volume
        self._keeping_rule = KeepingRule(
            p.pruning_threshold, low, high, p.max_components, model.near, model.height, CONFIRMED
        )

    def _with_frame(self, cameras: Int[ndarray, " S"] | None) -> tuple[StepModel, Calibrations]:
        """The model and cameras of a step at which some cameras have a frame.

        Args:
            cameras: Indices of the cameras that have a frame, None for all. Where none has, all
                cameras are returned, which the kernel then does not use.
        """
        if cameras is None:
            return self._step_model, self._cameras
        key = cameras.tobytes()
        if key not in self._seen_by:
            own = [self._model.cameras[c] for c in cameras.tolist()] or self._model.cameras
            clutter = self._model.clutter[cameras]
            self._seen_by[key] = self._step_model._replace(clutter=clutter), stacked(own)
        return self._seen_by[key]

    def start(self) -> MultiBernoulliState:
        """The state without tracks, before the first step."""
        dimension = self._model.motion.dimension
        empty = GaussianMixture.empty(dimension)
        return MultiBernoulliState(empty, empty, 1, Memory.start(dimension), IdentityBeliefs.none())

    def step(
        self,
        state: MultiBernoulliState,
        views: Many[ViewResult],
        constraints: PlaceConstraints | None = None,
    ) -> tuple[MultiBernoulliState, FusionResult]:
        """Predict one step ahead and update with every camera's boxes, in the cameras' order."""
        p, before = self._parameters, state.tracks
        alike = reidentification.appearance_ratios(state.identities, before.labels, views)
        seen = all_boxes(views)._replace(resemblance=alike)
        cameras = missing_frames.cameras_with_frame(views)
        step_model, calibrations = self._with_frame(cameras)
        found = step_kernels.predict_and_update(
            Tracks(before.weights, before.means, before.covariances, before.labels),
            state.next_label,
            state.undetected.gaussians,
            seen if cameras is None else missing_frames.boxes_of_cameras(seen, cameras),
            step_model,
            self._target,
            calibrations,
            self._camera_rule,
        )
        tracks = GaussianMixture(found.existences, found.means, found.covariances, found.labels)
        next_label, recent = found.next_label, state.recent
        record = Record(found.detection_probabilities, found.sources, found.shares, found.hidden_by)
        pair_cameras = found.pair_cameras
        if cameras is not None:
            record = missing_frames.extend_record(record, cameras, len(views))
            pair_cameras = cameras[pair_cameras]
        if p.birth != "entrances":
            evidence = Evidence(
                seen.boxes[:, :2],
                Measurements(found.values, found.noises),
                found.unexplained,
                seen.starts,
                seen.clutter_factors,
            )
            proposed, recent = self._model.newborns_and_recent(evidence, seen.boxes, views, recent)
            if proposed is not None:
                born, newborns = proposed
                born = models.label_births(born, next_label)
                next_label += born.size
                tracks, record = self._with_newborns(
                    tracks, record, born, newborns, state.next_label, cameras
                )
        if constraints is not None:
            tracks, record, next_label = apply_constraints(
                tracks, record, constraints, self._model,
                first_new_label=state.next_label, next_label=next_label,
            )  # fmt: skip
        if self._model.heights is not None:
            tracks = self._model.heights.truncate(tracks)
        kept = step_kernels.kept_tracks(
            tracks.weights, tracks.means, tracks.labels, record.sources, self._keeping_rule
        )
        tracks, record = tracks.take(kept), record.take(kept)
        labels, lost = memory.recall(state.memory, tracks, self._model, state.next_label)
        posterior = GaussianMixture(tracks.weights, tracks.means, tracks.covariances, labels)
        associations = sum_associations(
            tracks.labels,
            pair_cameras,
            found.pair_labels,
            found.pair_boxes,
            found.pair_probabilities,
        )
        recognised = state.identities
        if p.recognition:
            changed, recognised = reidentification.reidentify(
                recognised,
                posterior,
                associations,
                views,
                lost.lost.labels,
                self._model.step_time,
                p,
            )
            if changed:
                posterior, lost = posterior.relabelled(changed), lost.relabelled(changed)
        undetected, _ = gaussian_mixture.reduce(
            GaussianMixture(
                found.undetected_weights,
                found.undetected_means,
                found.undetected_covariances,
                np.zeros(len(found.undetected_weights), dtype=np.int64),
            ),
            pruning_threshold=p.pruning_threshold,
            merging_threshold=p.merging_threshold,
            max_components=p.max_components,
        )
        return (
            MultiBernoulliState(posterior, undetected, next_label, lost, recognised, recent),
            record.result(posterior, associations),
        )

    def _with_newborns(
        self,
        tracks: GaussianMixture,
        record: Record,
        born: GaussianMixture,
        newborns: Newborns,
        first_new_label: int,
        cameras: Int[ndarray, " S"] | None,
    ) -> tuple[GaussianMixture, Record]:
        """Append the tracks born from boxes of several cameras.

        Tracks that one of the same boxes began at an entrance in this step are removed.

        Args:
            tracks: J tracks before.
            record: Evidence of the J tracks.
            born: N tracks to append, with labels.
            newborns: The boxes behind the N tracks.
            first_new_label: The first label that was given in this step.
            cameras: Indices of the cameras that have a frame, None for all.
        """
        seeing = slice(None) if cameras is None else cameras
        # a track begun at an entrance by one of the same boxes is the same person
        own, proposed = record.sources[:, :, None], newborns.sources[:, None, :]
        shared = ((own == proposed) & (proposed >= 0)).any(axis=(0, 2))
        others = np.flatnonzero(~(shared & (tracks.labels >= first_new_label)))
        first = len(others)
        tracks = gaussian_mixture.concatenate([tracks.take(others), born])
        record = record.take(others).extended(born.size)
        record.sources[:, first:] = newborns.sources
        record.source_weights[:, first:] = newborns.sources >= 0
        record.detection_probabilities[seeing, first:] = self._parameters.detection_probability
        return tracks, record
