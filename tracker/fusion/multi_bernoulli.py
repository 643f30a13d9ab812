"""Fusion by the Poisson multi-Bernoulli filter: one existence, one place and one label a person.

[W15] J. L. Williams, "Marginal multi-Bernoulli filters: RFS derivation of MHT,
JIPDA, and association-based MeMBer", IEEE Transactions on Aerospace and
Electronic Systems 51(3), 2015: TOMB/P.
"""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker import association, bernoulli_kernels, gaussian_mixture, mixture_kernels, models
from tracker.fusion import memory, names, visibility
from tracker.fusion.measurement_births import CameraEvidence
from tracker.fusion.memory import Memory
from tracker.fusion.model import CONFIRMED, FusionModel
from tracker.fusion.names import Names
from tracker.fusion.protocol import FusionResult
from tracker.fusion.record import WORTH_TELLING, Ledger, Record
from tracker.gaussian_mixture import GaussianMixture
from tracker.parameters import FusionParams
from tracker.sequences.sequence import Sequence
from tracker.single_view.protocol import ViewResult
from tracker.update_kernels import Alternative


@dataclass(frozen=True, slots=True, eq=False)
class MultiBernoulliState:
    """Tracks, people never yet detected, the first free label, and who is lost from sight."""

    tracks: GaussianMixture
    undetected: GaussianMixture
    next_label: int
    memory: Memory
    names: Names


@dataclass(slots=True, eq=False)
class _Work:
    """One step while the cameras update it one after another."""

    tracks: GaussianMixture
    undetected: GaussianMixture
    next_label: int
    occluders: Float[ndarray, " n"]
    """Predicted existence of the tracks that are sure enough to hide others, else 0."""
    record: Record
    evidence: list[CameraEvidence]
    ledger: Ledger

    def add(self, newborns: GaussianMixture) -> None:
        """Append new tracks, which hide nobody yet, with labels of their own."""
        labelled = models.label_births(newborns, self.next_label)
        self.next_label += labelled.size
        self.tracks = gaussian_mixture.concatenate([self.tracks, labelled])
        self.occluders = np.concatenate([self.occluders, np.zeros(labelled.size)])
        self.record = self.record.extended(labelled.size)

    def take(self, indices: ndarray) -> None:
        """Keep some tracks, in that order."""
        self.tracks, self.record = self.tracks.take(indices), self.record.take(indices)
        self.occluders = self.occluders.take(indices)


class MultiBernoulli:
    """Fusion by TOMB/P with belief propagation, camera after camera ([W15]).

    A person who was detected is a Bernoulli: an existence probability, one
    Gaussian and a label for life. People not yet detected are the Poisson
    intensity of the PHD filter; a measurement that it explains begins a track,
    and so do unexplained boxes of several cameras that agree on a place.
    """

    def __init__(self, sequence: Sequence, parameters: FusionParams) -> None:
        self._parameters = parameters
        self._model = FusionModel(sequence, parameters)

    def start(self) -> MultiBernoulliState:
        """Nobody is in the room."""
        dimension = self._model.motion.dimension
        empty = GaussianMixture.empty(dimension)
        return MultiBernoulliState(empty, empty, 1, Memory.start(dimension), Names.none())

    def step(
        self, state: MultiBernoulliState, views: Many[ViewResult]
    ) -> tuple[MultiBernoulliState, FusionResult]:
        """Predict one step ahead and update with every camera's boxes, in the cameras' order."""
        p = self._parameters
        tracks = self._model.motion.predict(state.tracks, p.survival_probability)
        undetected = self._model.motion.predict(state.undetected, p.survival_probability)
        if p.birth != "measurements":
            undetected = gaussian_mixture.concatenate([undetected, self._model.births])
        work = _Work(
            tracks=tracks,
            undetected=undetected,
            next_label=state.next_label,
            occluders=np.where(tracks.weights > CONFIRMED, tracks.weights, 0.0),
            record=Record.blank(len(views), tracks.size),
            evidence=[],
            ledger=Ledger(),
        )
        for index, view in enumerate(views):
            self._update(work, index, view)
        if p.birth != "entrances":
            self._add_newborns(work, state.next_label)
        return self._finish(work, state, views)

    def _update(self, work: _Work, index: int, view: ViewResult) -> None:
        """The update of all tracks, and of the undetected, by the boxes of one camera."""
        p, model, tracks, unseen = self._parameters, self._model, work.tracks, work.undetected
        values, noises = model.target.measured(view, p.measurement_sigma)
        expected = model.target.expected(
            model.cameras[index],
            np.concatenate([unseen.means, tracks.means]),
            np.concatenate([unseen.covariances, tracks.covariances]),
        )
        (
            existences, means, covariances, chances, hidden_by, best, shares,
            left, newcomer, born_means, born_covariances, unexplained,
            who, what, chance,
        ) = bernoulli_kernels.update_by_camera(
            unseen.weights,
            unseen.means,
            unseen.covariances,
            tracks.weights,
            tracks.means,
            tracks.covariances,
            tracks.labels,
            work.occluders,
            values,
            noises,
            model.clutter[index],
            model.gate,
            expected.values,
            expected.jacobians,
            expected.spreads,
            expected.boxes,
            expected.depths,
            expected.valid,
            *(expected.other or Alternative.none(values.shape[1], unseen.dimension)),
            model.cameras[index].image_size,
            p.edge == "soft",
            p.detection_probability,
            CONFIRMED,
            p.occlusion,
            model.near,
            visibility.WORTH_TELLING,
            association.TOLERANCE,
            association.ITERATIONS,
            WORTH_TELLING,
        )  # fmt: skip
        work.tracks = GaussianMixture(existences, means, covariances, tracks.labels)
        work.undetected = GaussianMixture(left, unseen.means, unseen.covariances, unseen.labels)
        record = work.record
        record.detection_probabilities[index] = chances
        record.hidden_by[index] = hidden_by
        record.sources[index] = best
        record.source_weights[index] = shares
        work.ledger.add(index, tracks.labels.take(who), what, chance)
        work.evidence.append(model.evidence(index, view, values, noises, unexplained))
        self._begin_tracks(work, index, born_means, born_covariances, unexplained * newcomer)

    def _begin_tracks(
        self,
        work: _Work,
        index: int,
        means: Float[ndarray, "M d"],
        covariances: Float[ndarray, "M d d"],
        existences: Float[ndarray, " M"],
    ) -> None:
        """A track for every box that may be a newcomer's, with its existence."""
        chosen = (existences > self._parameters.pruning_threshold).nonzero()[0]
        if not len(chosen):
            return
        first = work.tracks.size
        nameless = np.zeros(len(chosen), dtype=np.int64)
        work.add(
            GaussianMixture(
                existences.take(chosen),
                means.take(chosen, 0),
                covariances.take(chosen, 0),
                nameless,
            )
        )
        work.record.sources[index, first:] = chosen
        work.record.source_weights[index, first:] = 1.0
        work.record.detection_probabilities[index, first:] = self._parameters.detection_probability
        work.ledger.add(index, work.tracks.labels[first:], chosen, existences.take(chosen))

    def _add_newborns(self, work: _Work, first_new_label: int) -> None:
        """Begin tracks where unexplained boxes of several cameras agree on a place."""
        found = self._model.newborns(work.evidence)
        if found is None:
            return
        born, newborns = found
        # a track begun at an entrance by one of the same boxes is the same person
        own, theirs = work.record.sources[:, :, None], newborns.sources[:, None, :]
        shared = ((own == theirs) & (theirs >= 0)).any(axis=(0, 2))
        work.take(np.flatnonzero(~(shared & (work.tracks.labels >= first_new_label))))
        first = work.tracks.size
        work.add(born)
        work.record.sources[:, first:] = newborns.sources
        work.record.source_weights[:, first:] = newborns.sources >= 0
        work.record.detection_probabilities[:, first:] = self._parameters.detection_probability

    def _finish(
        self, work: _Work, state: MultiBernoulliState, views: Many[ViewResult]
    ) -> tuple[MultiBernoulliState, FusionResult]:
        """Drop the faint, the strayed and the doubles; the rest is the step's posterior."""
        p, weights = self._parameters, work.tracks.weights
        alive = self._model.stays(work.tracks)
        alive = alive.compress(weights.take(alive) >= p.pruning_threshold)
        order = mixture_kernels.heaviest_first(weights.take(alive))[: p.max_components]
        work.take(alive.take(order))
        tracks = work.tracks
        double = self._model.doubles(
            tracks.means, tracks.weights, tracks.labels, work.record.sources
        )
        if double.any():
            work.take((~double).nonzero()[0])
            tracks = work.tracks
        labels, lost = memory.recall(state.memory, tracks, self._model, state.next_label)
        posterior = GaussianMixture(tracks.weights, tracks.means, tracks.covariances, labels)
        associations = work.ledger.associations(tracks.labels)
        found = state.names
        if p.recognition:
            renamed, found = names.recognise(
                found, posterior, associations, views, lost.lost.labels, self._model.step_time
            )
            if renamed:
                posterior, lost = posterior.renamed(renamed), lost.renamed(renamed)
        undetected, _ = gaussian_mixture.reduce(
            work.undetected,
            pruning_threshold=p.pruning_threshold,
            merging_threshold=p.merging_threshold,
            max_components=p.max_components,
        )
        return (
            MultiBernoulliState(posterior, undetected, work.next_label, lost, found),
            work.record.result(posterior, associations),
        )
