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

from tracker import gaussian_mixture, kernels, models, phd, pmb
from tracker.fusion import memory, names
from tracker.fusion.measurement_births import CameraEvidence
from tracker.fusion.memory import Memory
from tracker.fusion.model import CONFIRMED, FusionModel
from tracker.fusion.names import Names
from tracker.fusion.protocol import FusionResult
from tracker.fusion.record import Ledger, Record
from tracker.gaussian_mixture import GaussianMixture
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
        self.occluders = self.occluders[indices]


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
        model, tracks, record = self._model, work.tracks, work.record
        values, noises = model.target.measured(view, self._parameters.measurement_sigma)
        expected = model.expected(index, tracks)
        seen = model.visible(index, expected, tracks, work.occluders)
        newcomer, newborns = self._undetected(work, index, values, noises)
        updated = pmb.update(
            tracks,
            values,
            expected=expected.values,
            jacobians=expected.jacobians,
            noise=noises,
            spread=expected.spreads,
            detection_probability=seen.detection_probabilities,
            unexplained_intensity=model.clutter[index] / (1.0 - newcomer),  # κ + e
            gate=model.gate,
            other=expected.other,
        )
        marginals = updated.marginals
        work.tracks = updated.tracks
        record.detection_probabilities[index] = seen.detection_probabilities
        record.hidden_by[index] = seen.hidden_by
        if len(values) and tracks.size:
            best = marginals.detected.argmax(axis=1)
            share = marginals.detected[np.arange(tracks.size), best]
            found = share > marginals.missed
            record.sources[index] = np.where(found, best, -1)
            record.source_weights[index] = np.where(found, share, 0.0)
            who, what = np.nonzero(marginals.detected)
            work.ledger.add(index, tracks.labels[who], what, marginals.detected[who, what])
        work.evidence.append(model.evidence(index, view, values, noises, marginals.unexplained))
        self._begin_tracks(work, index, newborns, marginals.unexplained * newcomer)

    def _undetected(
        self,
        work: _Work,
        index: int,
        values: Float[ndarray, "M m"],
        noises: Float[ndarray, "M m m"],
    ) -> tuple[Float[ndarray, " M"], GaussianMixture]:
        """Update the people not yet detected by one camera.

        Returns:
            e_j / (κ + e_j) for each box: the share of the unexplained that is a
            newcomer; and where that newcomer would be, one Gaussian a box (nowhere, all 0,
            where none can be).
        """
        intensity, model = work.undetected, self._model
        count = len(values)
        expected = model.expected(index, intensity)
        updated = phd.update(
            intensity,
            values,
            expected=expected.values,
            jacobians=expected.jacobians,
            noise=noises,
            spread=expected.spreads,
            detection_probability=model.chances(index, expected, intensity),
            clutter_intensity=model.clutter[index],
            gate=model.gate,
            other=expected.other,
        )
        posterior = updated.posterior
        work.undetected = posterior.take(slice(intensity.size))
        pairs = slice(intensity.size, None)
        newborns = GaussianMixture(
            *kernels.merge_moments(
                posterior.weights[pairs],
                posterior.means[pairs],
                posterior.covariances[pairs],
                updated.measurements[pairs],
                count,
            ),
            labels=np.zeros(count, dtype=np.int64),
        )
        return np.minimum(updated.measurement_weights, 1.0 - 1e-9), newborns

    def _begin_tracks(
        self, work: _Work, index: int, newborns: GaussianMixture, existences: Float[ndarray, " M"]
    ) -> None:
        """A track for every box that may be a newcomer's, with its existence."""
        chosen = np.flatnonzero(existences > self._parameters.pruning_threshold)
        if not len(chosen):
            return
        first = work.tracks.size
        newborns = newborns.take(chosen)
        work.add(
            GaussianMixture(
                existences[chosen], newborns.means, newborns.covariances, newborns.labels
            )
        )
        work.record.sources[index, first:] = chosen
        work.record.source_weights[index, first:] = 1.0
        work.record.detection_probabilities[index, first:] = self._parameters.detection_probability
        work.ledger.add(index, work.tracks.labels[first:], chosen, existences[chosen])

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
        alive = alive[weights[alive] >= p.pruning_threshold]
        work.take(alive[np.argsort(-weights[alive], kind="stable")][: p.max_components])
        tracks = work.tracks
        work.take(
            np.flatnonzero(
                ~self._model.doubles(
                    tracks.means, tracks.weights, tracks.labels, work.record.sources
                )
            )
        )
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
