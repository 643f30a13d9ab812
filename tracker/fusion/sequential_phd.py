"""The published fusion: one GM-PHD intensity in 3D, updated by camera after camera.

[ZW21] Zhu, Wang, "3D target position tracking based on probability hypothesis
density filtering", 2021, §2.4.
"""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker import gaussian_mixture, models, phd
from tracker.fusion.measurement_births import CameraEvidence
from tracker.fusion.model import CONFIRMED, FusionModel
from tracker.fusion.protocol import FusionResult
from tracker.fusion.record import Record
from tracker.gaussian_mixture import GaussianMixture
from tracker.parameters import FusionParams
from tracker.phd import PhdUpdate
from tracker.sequences.sequence import Sequence
from tracker.single_view.protocol import ViewResult


@dataclass(frozen=True, slots=True, eq=False)
class SequentialPhdState:
    """The posterior of the step before, and the first label that is still free."""

    mixture: GaussianMixture
    next_label: int


@dataclass(slots=True, eq=False)
class _Work:
    """One step while the cameras update it one after another."""

    mixture: GaussianMixture
    record: Record
    next_label: int
    sure: dict[int, float]
    """Predicted weight of each label, where it is enough to hide others."""
    evidence: list[CameraEvidence]


class SequentialPhd:
    """Fusion by the sequential-sensor GM-PHD filter ([ZW21] §2.4).

    The intensity is predicted once, with births; then camera 1's boxes update it,
    the result is the prior for camera 2, and so on. The published scheme takes the
    centre of a box, a random walk of (x, y, z), births at the entrances only, one
    p_D inside the picture and the plain recursion of camera after camera; each is
    one value of a parameter, and the ``published`` preset sets them all.
    """

    def __init__(self, sequence: Sequence, parameters: FusionParams) -> None:
        self._parameters = parameters
        self._model = FusionModel(sequence, parameters)

    def start(self) -> SequentialPhdState:
        """Nobody is in the room."""
        return SequentialPhdState(GaussianMixture.empty(self._model.motion.dimension), 1)

    def step(
        self, state: SequentialPhdState, views: Many[ViewResult]
    ) -> tuple[SequentialPhdState, FusionResult]:
        """Predict one step ahead and update with every camera's boxes, in the cameras' order."""
        p = self._parameters
        mixture = self._model.motion.predict(state.mixture, p.survival_probability)
        # heaviest first, so read from the end: a label's heaviest component has the last word
        previous = dict(zip(mixture.labels[::-1].tolist(), mixture.means[::-1, :3], strict=True))
        sure = _confirmed_labels(mixture)
        next_label = state.next_label
        if p.birth != "measurements":
            births = models.label_births(self._model.births, next_label)
            next_label += births.size
            mixture = gaussian_mixture.concatenate([mixture, births])
        work = _Work(mixture, Record.blank(len(views), mixture.size), next_label, sure, evidence=[])
        for index, view in enumerate(views):
            self._update(work, index, view)
        if p.birth != "entrances":
            self._add_newborns(work)
        inside = self._model.stays(work.mixture)
        mixture, record = work.mixture.take(inside), work.record.take(inside)
        labels, next_label = _one_person_a_label(mixture, previous, work.next_label)
        mixture = GaussianMixture(mixture.weights, mixture.means, mixture.covariances, labels)
        return SequentialPhdState(mixture, next_label), record.result(mixture)

    def _update(self, work: _Work, index: int, view: ViewResult) -> None:
        """The update by the boxes of one camera, and its reduction."""
        p, model, mixture = self._parameters, self._model, work.mixture
        values, noises = model.target.measured(view, p.measurement_sigma)
        expected = model.target.expected(model.cameras[index], mixture.means)
        occluders = _occluders(mixture, work.sure)
        seen = model.visible(index, expected, mixture, occluders)
        updated = phd.update(
            mixture,
            values,
            expected=expected.values,
            jacobians=expected.jacobians,
            noise=noises,
            detection_probability=seen.detection_probabilities,
            clutter_intensity=model.clutter[index],
            gate=model.gate,
        )
        posterior = updated.posterior
        if p.misses == "per_person":
            posterior = _miss_per_person(mixture, updated, seen.detection_probabilities)
        parents, sources = updated.parents, updated.measurements
        record = work.record.take(parents)
        record.detection_probabilities[index] = seen.detection_probabilities[parents]
        record.hidden_by[index] = seen.hidden_by[parents]
        record.sources[index] = sources
        record.source_weights[index] = np.where(sources >= 0, posterior.weights, 0.0)
        work.mixture, leaders = gaussian_mixture.reduce(
            posterior,
            pruning_threshold=p.pruning_threshold,
            merging_threshold=p.merging_threshold,
            max_components=p.max_components,
        )
        work.record = record.take(leaders)
        if p.birth == "entrances":
            return
        work.evidence.append(
            CameraEvidence(
                rays=model.cameras[index].back_project(view.boxes[:, :2]),
                values=values,
                noises=noises,
                unexplained=1.0 - updated.measurement_weights,
                clutter_intensity=model.clutter[index],
            )
        )

    def _add_newborns(self, work: _Work) -> None:
        """Components where unexplained boxes of several cameras agree on a place."""
        found = self._model.newborns.propose(work.evidence)
        if not found:
            return
        born = GaussianMixture(
            np.array([newborn.existence for newborn in found]),
            np.stack([newborn.position for newborn in found]),
            np.stack([newborn.covariance for newborn in found]),
            np.zeros(len(found), dtype=np.int64),
        )
        born = models.label_births(self._model.motion.at_rest(born), work.next_label)
        work.next_label += born.size
        first = work.mixture.size
        work.mixture = gaussian_mixture.concatenate([work.mixture, born])
        work.record = work.record.extended(born.size)
        sources = np.stack([newborn.sources for newborn in found], axis=1)
        work.record.sources[:, first:] = sources
        work.record.source_weights[:, first:] = sources >= 0
        work.record.detection_probabilities[:, first:] = self._parameters.detection_probability


def _confirmed_labels(mixture: GaussianMixture) -> dict[int, float]:
    """The labels that stand for a person, with their weight."""
    sure = np.flatnonzero(mixture.weights > CONFIRMED)
    return dict(zip(mixture.labels[sure].tolist(), mixture.weights[sure].tolist(), strict=True))


def _occluders(mixture: GaussianMixture, sure: dict[int, float]) -> Float[ndarray, " J"]:
    """The weight with which each component hides others, 0 for most.

    A person hides others once: by the heaviest component of the label, which comes first.
    """
    weights = np.zeros(mixture.size)
    left = dict(sure)
    for component, label in enumerate(mixture.labels.tolist()):
        weights[component] = left.pop(label, 0.0)
    return weights


def _miss_per_person(
    predicted: GaussianMixture, updated: PhdUpdate, detection_probability: Float[ndarray, " J"]
) -> GaussianMixture:
    """Scale the missed components so that the order of the cameras does not matter.

    The PHD takes the number of people as Poisson, so one camera's miss multiplies
    a weight by 1 − p_D whatever the cameras before saw. Taken as one person who is
    there with probability r, the components of one label keep

        w ← w (1 − p_D) / (1 − r p_D) · (1 − D)

    with D the share of the label that this camera's boxes explain. For one person
    alone that is Bayes' rule for existence, which asks for no order.
    """
    size = predicted.size
    labels, label = np.unique(predicted.labels, return_inverse=True)
    weights = updated.posterior.weights.copy()
    there = np.zeros(len(labels))
    np.add.at(there, label, predicted.weights * detection_probability)
    explained = np.zeros(len(labels))
    np.add.at(explained, label[updated.parents[size:]], weights[size:])
    factor = (1.0 - np.minimum(explained, 1.0)) / np.maximum(1.0 - np.minimum(there, 1.0), 1e-9)
    # a lone, certain label that nobody could have missed keeps at most what it had
    weights[:size] = np.minimum(weights[:size] * factor[label], predicted.weights)
    return GaussianMixture(
        weights,
        updated.posterior.means,
        updated.posterior.covariances,
        updated.posterior.labels,
    )


def _one_person_a_label(
    mixture: GaussianMixture, previous: dict[int, ndarray], next_label: int
) -> tuple[Int[ndarray, " J"], int]:
    """Give a new label to every confirmed component but one that shares a label.

    The one nearest to where the label was predicted keeps it: two people who
    were born as one component go on as two tracks from the step they part.
    """
    labels = mixture.labels.copy()
    confirmed = np.flatnonzero(mixture.weights > CONFIRMED)
    for label in np.unique(labels[confirmed]).tolist():
        bearers = confirmed[labels[confirmed] == label]
        if len(bearers) < 2:
            continue
        place = previous.get(label, mixture.means[bearers[0], :3])
        distances = np.linalg.norm(mixture.means[bearers, :3] - place, axis=1)
        for other in np.delete(bearers, int(np.argmin(distances))):
            labels[other] = next_label
            next_label += 1
    return labels, next_label
