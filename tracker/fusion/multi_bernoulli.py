"""Fusion by the Poisson multi-Bernoulli filter: one existence, one place and one label a person.

[W15] J. L. Williams, "Marginal multi-Bernoulli filters: RFS derivation of MHT,
JIPDA, and association-based MeMBer", IEEE Transactions on Aerospace and
Electronic Systems 51(3), 2015: TOMB/P.
"""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Int
from numpy import ndarray

from tracker import association
from tracker.camera import stacked
from tracker.filters import gaussian_mixture, models
from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.fusion import memory, names, sight, visibility
from tracker.fusion.measurement_births import Evidence, Newborns
from tracker.fusion.memory import Memory
from tracker.fusion.model import CONFIRMED, FusionModel, all_boxes
from tracker.fusion.names import Names
from tracker.fusion.protocol import FusionResult
from tracker.fusion.record import WORTH_TELLING, Record, summed
from tracker.fusion.sight import Recent
from tracker.kernels.labelled import step as step_kernels
from tracker.parameters import FusionParams
from tracker.sequences.sequence import Sequence
from tracker.single_view.protocol import ViewResult


@dataclass(frozen=True, slots=True, eq=False)
class MultiBernoulliState:
    """Tracks, people never yet detected, the first free label, and who is lost from sight."""

    tracks: GaussianMixture
    undetected: GaussianMixture
    next_label: int
    memory: Memory
    names: Names
    recent: Recent = ()
    """What each camera left unexplained in its last frame."""


class MultiBernoulli:
    """Fusion by TOMB/P with belief propagation, camera after camera ([W15]).

    A person who was detected is a Bernoulli: an existence probability, one
    Gaussian and a label for life. People not yet detected are the Poisson
    intensity of the PHD filter; a measurement that it explains begins a track,
    and so do unexplained boxes of several cameras that agree on a place.
    """

    def __init__(self, sequence: Sequence, parameters: FusionParams) -> None:
        model = FusionModel(sequence, parameters)
        self._parameters, self._model = parameters, model
        self._of_cameras: dict[bytes, tuple[Any, ...]] = {}
        """The same where some cameras have no frame, by those that have."""
        self._fixed = self._told_of(np.arange(len(model.cameras)))
        """What :func:`tracker.kernels.labelled.step.predict_and_update` is told at every step."""

    def _told_of(self, cameras: Int[ndarray, " S"]) -> tuple[Any, ...]:
        """What the step's kernel is told at every step at which these cameras have a frame."""
        p, model = self._parameters, self._model
        motion, target = model.motion, model.target
        births = model.births
        if p.birth == "measurements":
            births = GaussianMixture.empty(motion.dimension)
        own = tuple(model.cameras[c] for c in cameras.tolist())
        return (
            *(motion.transition, motion.noise[None], p.survival_probability),
            *(births.weights, births.means, births.covariances),
            *(p.measurement_sigma, *target.transforms, target.unscented, *target.numbers),
            *(target.drift(motion.dimension), target.low_share),
            *(*stacked(own), model.clutter[cameras], model.gate, p.edge == "soft"),
            *(p.detection_probability, CONFIRMED, p.occlusion, model.near),
            *(visibility.WORTH_TELLING, association.TOLERANCE, association.ITERATIONS),
            *(WORTH_TELLING, p.pruning_threshold),
        )

    def _seeing(self, cameras: Int[ndarray, " S"]) -> tuple[Any, ...]:
        """As :meth:`_told_of`, made once for the same cameras; of none the kernel asks nothing."""
        if not len(cameras):
            return self._fixed
        key = cameras.tobytes()
        if key not in self._of_cameras:
            self._of_cameras[key] = self._told_of(cameras)
        return self._of_cameras[key]

    def start(self) -> MultiBernoulliState:
        """Nobody is in the room."""
        dimension = self._model.motion.dimension
        empty = GaussianMixture.empty(dimension)
        return MultiBernoulliState(empty, empty, 1, Memory.start(dimension), Names.none())

    def step(
        self, state: MultiBernoulliState, views: Many[ViewResult]
    ) -> tuple[MultiBernoulliState, FusionResult]:
        """Predict one step ahead and update with every camera's boxes, in the cameras' order."""
        p, before, unseen = self._parameters, state.tracks, state.undetected
        boxes, sigmas, starts = all_boxes(views)
        cameras = sight.seeing(views)
        fixed, own_starts = self._fixed, starts
        if cameras is not None:
            fixed = self._seeing(cameras)
            own_starts = np.append(starts[:-1][cameras], starts[-1])  # others have no boxes
        (
            existences, means, covariances, labels, next_label,
            left, unseen_means, unseen_covariances,
            chances, hidden_by, sources, shares,
            *told, values, noises, unexplained,
        ) = step_kernels.predict_and_update(
            *(before.weights, before.means, before.covariances, before.labels, state.next_label),
            *(unseen.weights, unseen.means, unseen.covariances),
            *(boxes, sigmas, own_starts, *fixed),
        )  # fmt: skip
        tracks = GaussianMixture(existences, means, covariances, labels)
        record = Record(chances, sources, shares, hidden_by)
        if cameras is not None:
            told[0] = cameras[told[0]]
            record = sight.spread(record, cameras, len(views))
        recent = state.recent
        if p.birth != "entrances":
            evidence = Evidence(boxes[:, :2], values, noises, unexplained, starts)
            found, recent = self._model.newborns_and_recent(evidence, boxes, views, recent)
            if found is not None:
                tracks, record, next_label = self._with_newborns(
                    tracks, record, *found, state.next_label, next_label, cameras
                )
        kept = step_kernels.kept_tracks(
            *(tracks.weights, tracks.means, tracks.labels, record.sources, p.pruning_threshold),
            *(*self._model.followed, p.max_components, self._model.near, CONFIRMED),
        )
        tracks, record = tracks.take(kept), record.take(kept)
        labels, lost = memory.recall(state.memory, tracks, self._model, state.next_label)
        posterior = GaussianMixture(tracks.weights, tracks.means, tracks.covariances, labels)
        associations = summed(tracks.labels, *told)
        recognised = state.names
        if p.recognition:
            renamed, recognised = names.recognise(
                recognised, posterior, associations, views, lost.lost.labels, self._model.step_time
            )
            if renamed:
                posterior, lost = posterior.renamed(renamed), lost.renamed(renamed)
        undetected, _ = gaussian_mixture.reduce(
            GaussianMixture(
                left, unseen_means, unseen_covariances, np.zeros(len(left), dtype=np.int64)
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
        next_label: int,
        cameras: Int[ndarray, " S"] | None,
    ) -> tuple[GaussianMixture, Record, int]:
        """The tracks with those that begin where unexplained boxes of several cameras agree."""
        seeing = slice(None) if cameras is None else cameras
        # a track begun at an entrance by one of the same boxes is the same person
        own, theirs = record.sources[:, :, None], newborns.sources[:, None, :]
        shared = ((own == theirs) & (theirs >= 0)).any(axis=(0, 2))
        others = np.flatnonzero(~(shared & (tracks.labels >= first_new_label)))
        first = len(others)
        labelled = models.label_births(born, next_label)
        tracks = gaussian_mixture.concatenate([tracks.take(others), labelled])
        record = record.take(others).extended(born.size)
        record.sources[:, first:] = newborns.sources
        record.source_weights[:, first:] = newborns.sources >= 0
        record.detection_probabilities[seeing, first:] = self._parameters.detection_probability
        return tracks, record, next_label + born.size
