"""Fusion by the Poisson multi-Bernoulli filter: one existence, one place and one label a person.

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
from tracker.fusion import missing_frames
from tracker.fusion.constraint_update import obey
from tracker.fusion.labels import memory, reidentification
from tracker.fusion.labels.memory import Memory
from tracker.fusion.labels.reidentification import Identities
from tracker.fusion.measurement_births import Evidence, Newborns
from tracker.fusion.missing_frames import Recent
from tracker.fusion.model import CONFIRMED, FusionModel, all_boxes
from tracker.fusion.place_constraints import PlaceConstraints
from tracker.fusion.protocol import FusionResult
from tracker.fusion.record import WORTH_TELLING, Record, summed
from tracker.geometry.camera import stacked
from tracker.kernels.gating import Measurements
from tracker.kernels.labelled import step as step_kernels
from tracker.kernels.labelled.camera_update import Tracks
from tracker.kernels.labelled.step import KeepingRule, StepModel
from tracker.kernels.lens import Calibrations
from tracker.sequences.sequence import Sequence
from tracker.single_view.protocol import ViewResult

if TYPE_CHECKING:
    from tracker.parameters import RunParameters


@dataclass(frozen=True, slots=True, eq=False)
class MultiBernoulliState:
    """Tracks, people never yet detected, the first free label, and who is lost from sight."""

    tracks: GaussianMixture
    undetected: GaussianMixture
    next_label: int
    memory: Memory
    identities: Identities
    recent: Recent = ()
    """What each camera left unexplained in the last frames."""


class MultiBernoulli:
    """Fusion by TOMB/P with belief propagation, camera after camera ([W15]).

    A person who was detected is a Bernoulli: an existence probability, one
    Gaussian and a label for life. People not yet detected are the Poisson
    intensity of the PHD filter; a measurement that it explains begins a track,
    and so do unexplained boxes of several cameras that agree on a place.
    """

    def __init__(self, sequence: Sequence, parameters: RunParameters) -> None:
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
        """Model and cameras where some have no frame, by those that have."""
        self._target = target.target(motion.dimension)
        self._camera_rule = model.camera_rule(WORTH_TELLING)
        low, high = model.followed
        self._keeping_rule = KeepingRule(
            p.pruning_threshold, low, high, p.max_components, model.near, model.height, CONFIRMED
        )

    def _with_frame(self, cameras: Int[ndarray, " S"] | None) -> tuple[StepModel, Calibrations]:
        """The step's model and cameras where only these have a frame, or all where None is said;
        where none has, the kernel asks for nothing of them."""
        if cameras is None:
            return self._step_model, self._cameras
        key = cameras.tobytes()
        if key not in self._seen_by:
            own = [self._model.cameras[c] for c in cameras.tolist()] or self._model.cameras
            clutter = self._model.clutter[cameras]
            self._seen_by[key] = self._step_model._replace(clutter=clutter), stacked(own)
        return self._seen_by[key]

    def start(self) -> MultiBernoulliState:
        """Nobody is in the room."""
        dimension = self._model.motion.dimension
        empty = GaussianMixture.empty(dimension)
        return MultiBernoulliState(empty, empty, 1, Memory.start(dimension), Identities.none())

    def step(
        self,
        state: MultiBernoulliState,
        views: Many[ViewResult],
        told: PlaceConstraints | None = None,
    ) -> tuple[MultiBernoulliState, FusionResult]:
        """Predict one step ahead and update with every camera's boxes, in the cameras' order."""
        p, before = self._parameters, state.tracks
        seen = all_boxes(views)
        if p.recognition:
            alike = reidentification.resemblance(state.identities, before.labels, views)
            seen = seen._replace(resemblance=alike)
        cameras = missing_frames.seeing(views)
        step_model, calibrations = self._with_frame(cameras)
        found = step_kernels.predict_and_update(
            Tracks(before.weights, before.means, before.covariances, before.labels),
            state.next_label,
            state.undetected.gaussians,
            seen if cameras is None else missing_frames.boxes_of(seen, cameras),
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
            record = missing_frames.spread(record, cameras, len(views))
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
        if told is not None:
            tracks, record, next_label = obey(
                tracks, record, told, self._model,
                first_new_label=state.next_label, next_label=next_label,
            )  # fmt: skip
        kept = step_kernels.kept_tracks(
            tracks.weights, tracks.means, tracks.labels, record.sources, self._keeping_rule
        )
        tracks, record = tracks.take(kept), record.take(kept)
        labels, lost = memory.recall(state.memory, tracks, self._model, state.next_label)
        posterior = GaussianMixture(tracks.weights, tracks.means, tracks.covariances, labels)
        associations = summed(
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
        """The tracks with those that begin where unexplained boxes of several cameras agree."""
        seeing = slice(None) if cameras is None else cameras
        # a track begun at an entrance by one of the same boxes is the same person
        own, theirs = record.sources[:, :, None], newborns.sources[:, None, :]
        shared = ((own == theirs) & (theirs >= 0)).any(axis=(0, 2))
        others = np.flatnonzero(~(shared & (tracks.labels >= first_new_label)))
        first = len(others)
        tracks = gaussian_mixture.concatenate([tracks.take(others), born])
        record = record.take(others).extended(born.size)
        record.sources[:, first:] = newborns.sources
        record.source_weights[:, first:] = newborns.sources >= 0
        record.detection_probabilities[seeing, first:] = self._parameters.detection_probability
        return tracks, record
