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
from tracker.fusion import visibility
from tracker.fusion.measurement_births import CameraEvidence
from tracker.fusion.model import CONFIRMED, FusionModel
from tracker.fusion.protocol import FusionResult
from tracker.fusion.record import Record
from tracker.gaussian_mixture import GaussianMixture
from tracker.parameters import FusionParams
from tracker.sequences.sequence import Sequence
from tracker.single_view.protocol import ViewResult


@dataclass(frozen=True, slots=True, eq=False)
class MultiBernoulliState:
    """Tracks, the intensity of people never yet detected, and the first free label."""

    tracks: GaussianMixture
    undetected: GaussianMixture
    next_label: int


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

    def add(self, newborns: GaussianMixture) -> None:
        """Append new tracks, which hide nobody yet, with labels of their own."""
        labelled = models.label_births(newborns, self.next_label)
        self.next_label += labelled.size
        self.tracks = gaussian_mixture.concatenate([self.tracks, labelled])
        self.occluders = np.concatenate([self.occluders, np.zeros(labelled.size)])
        self.record = self.record.extended(labelled.size)


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
        empty = GaussianMixture.empty(self._model.motion.dimension)
        return MultiBernoulliState(empty, empty, next_label=1)

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
            record=Record.blank(len(self._model.cameras), tracks.size),
            evidence=[],
        )
        for index, view in enumerate(views):
            self._update(work, index, view)
        if p.birth != "entrances":
            self._add_newborns(work, state.next_label)
        return self._finish(work)

    def _update(self, work: _Work, index: int, view: ViewResult) -> None:
        """The update of all tracks, and of the undetected, by the boxes of one camera."""
        camera, tracks = self._model.cameras[index], work.tracks
        values, noises = self._model.target.measured(view, self._parameters.measurement_sigma)
        expected = self._model.target.expected(camera, tracks.means)
        seen = self._model.visible(index, expected, tracks, work.occluders)
        newcomer, newborns = self._undetected(work, index, values, noises)
        updated = pmb.update(
            tracks,
            values,
            expected=expected.values,
            jacobians=expected.jacobians,
            noise=noises,
            detection_probability=seen.detection_probabilities,
            unexplained_intensity=self._model.clutter[index] / (1.0 - newcomer),  # κ + e
            gate=self._model.gate,
        )
        marginals, record = updated.marginals, work.record
        work.tracks = updated.tracks
        record.detection_probabilities[index] = seen.detection_probabilities
        record.hidden_by[index] = seen.hidden_by
        if len(values) and tracks.size:
            best = marginals.detected.argmax(axis=1)
            share = marginals.detected[np.arange(tracks.size), best]
            record.sources[index] = np.where(share > marginals.missed, best, -1)
            record.source_weights[index] = share
        work.evidence.append(
            CameraEvidence(
                rays=camera.back_project(view.boxes[:, :2]),
                values=values,
                noises=noises,
                unexplained=marginals.unexplained,
                clutter_intensity=self._model.clutter[index],
            )
        )
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
            newcomer; and where that newcomer would be, one Gaussian a box.
        """
        intensity, camera = work.undetected, self._model.cameras[index]
        count = len(values)
        nobody = GaussianMixture(
            np.zeros(count),
            np.zeros((count, intensity.dimension)),
            np.tile(np.eye(intensity.dimension), (count, 1, 1)),
            np.zeros(count, dtype=np.int64),
        )
        if intensity.size == 0:
            return np.zeros(count), nobody
        expected = self._model.target.expected(camera, intensity.means)
        updated = phd.update(
            intensity,
            values,
            expected=expected.values,
            jacobians=expected.jacobians,
            noise=noises,
            detection_probability=self._parameters.detection_probability
            * visibility.inside_probability(camera, expected, intensity.covariances),
            clutter_intensity=self._model.clutter[index],
            gate=self._model.gate,
        )
        work.undetected = updated.posterior.take(np.arange(intensity.size))
        pairs = updated.posterior.take(np.arange(intensity.size, updated.posterior.size))
        # a faint copy of nobody keeps every group filled
        weights, means, covariances = kernels.merge_moments(
            np.concatenate([np.full(count, 1e-12), pairs.weights]),
            np.concatenate([nobody.means, pairs.means]),
            np.concatenate([nobody.covariances, pairs.covariances]),
            np.concatenate([np.arange(count), updated.measurements[intensity.size :]]),
            count,
        )
        newborns = GaussianMixture(weights, means, covariances, nobody.labels)
        return np.minimum(updated.measurement_weights, 1.0 - 1e-9), newborns

    def _begin_tracks(
        self, work: _Work, index: int, newborns: GaussianMixture, existences: Float[ndarray, " M"]
    ) -> None:
        """A track for every box that may be a newcomer's, with its existence."""
        chosen = np.flatnonzero(existences > self._parameters.pruning_threshold)
        first = work.tracks.size
        work.add(
            GaussianMixture(
                existences[chosen],
                newborns.means[chosen],
                newborns.covariances[chosen],
                newborns.labels[chosen],
            )
        )
        work.record.sources[index, first:] = chosen
        work.record.source_weights[index, first:] = 1.0
        work.record.detection_probabilities[index, first:] = self._parameters.detection_probability

    def _add_newborns(self, work: _Work, first_new_label: int) -> None:
        """Begin tracks where unexplained boxes of several cameras agree on a place."""
        found = self._model.newborns.propose(work.evidence)
        if not found:
            return
        # a track begun at an entrance by one of the same boxes is the same person
        sources = np.stack([newborn.sources for newborn in found], axis=1)
        record = work.record
        shares = (record.sources[:, :, None] == sources[:, None, :]) & (sources[:, None, :] >= 0)
        twin = (work.tracks.labels >= first_new_label) & shares.any(axis=(0, 2))
        kept = np.flatnonzero(~twin)
        work.tracks, work.record = work.tracks.take(kept), record.take(kept)
        work.occluders = work.occluders[kept]
        born = GaussianMixture(
            np.array([newborn.existence for newborn in found]),
            np.stack([newborn.position for newborn in found]),
            np.stack([newborn.covariance for newborn in found]),
            np.zeros(len(found), dtype=np.int64),
        )
        first = work.tracks.size
        work.add(self._model.motion.at_rest(born))
        work.record.sources[:, first:] = sources
        work.record.source_weights[:, first:] = sources >= 0
        work.record.detection_probabilities[:, first:] = self._parameters.detection_probability

    def _finish(self, work: _Work) -> tuple[MultiBernoulliState, FusionResult]:
        """Drop the faint, the strayed and the doubles; the rest is the step's posterior."""
        p, tracks = self._parameters, work.tracks
        alive = self._model.stays(tracks)
        alive = alive[tracks.weights[alive] >= p.pruning_threshold]
        order = alive[np.argsort(-tracks.weights[alive], kind="stable")]
        order = order[: p.max_components]
        order = order[~self._doubles(work, order)]
        posterior = tracks.take(order)
        undetected, _ = gaussian_mixture.reduce(
            work.undetected,
            pruning_threshold=p.pruning_threshold,
            merging_threshold=p.merging_threshold,
            max_components=p.max_components,
        )
        state = MultiBernoulliState(posterior, undetected, work.next_label)
        return state, work.record.take(order).result(posterior)

    def _doubles(self, work: _Work, order: ndarray) -> ndarray:
        """Which tracks only repeat a surer or older one at the same place.

        Two tracks nearer than the target is wide are one person, unless some
        camera gave each a box of its own.
        """
        means, labels = work.tracks.means[order, :3], work.tracks.labels[order]
        sources = work.record.sources[:, order]
        near = np.linalg.norm(means[:, None] - means[None], axis=2) < self._model.near
        both = (sources[:, :, None] >= 0) & (sources[:, None, :] >= 0)
        parted = (both & (sources[:, :, None] != sources[:, None, :])).any(axis=0)
        older = labels[:, None] > labels[None, :]
        sure = work.tracks.weights[order] > CONFIRMED
        # among sure tracks the older label stays; an unsure one never displaces a sure one
        yields = np.where(sure[:, None] == sure[None, :], older, sure[None, :])
        return np.asarray((near & ~parted & yields).any(axis=1))
