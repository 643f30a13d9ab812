"""The published fusion: one GM-PHD intensity in 3D, updated by camera after camera.

[ZW21] Zhu, Wang, "3D target position tracking based on probability hypothesis
density filtering", 2021, §2.4.
"""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.filters import gaussian_mixture, models, phd
from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.fusion import missing_frames
from tracker.fusion.constraint_update import obey
from tracker.fusion.labels import memory, one_person
from tracker.fusion.labels.memory import Memory
from tracker.fusion.measurement_births import Evidence
from tracker.fusion.missing_frames import Recent
from tracker.fusion.model import CONFIRMED, FusionModel, all_boxes
from tracker.fusion.place_constraints import PlaceConstraints
from tracker.fusion.protocol import FusionResult
from tracker.fusion.record import Ledger, Record
from tracker.kernels import linear_algebra
from tracker.kernels.gating import Measurements
from tracker.kernels.intensity import mixture as mixture_kernels
from tracker.sequences.sequence import Sequence
from tracker.single_view.protocol import ViewResult

if TYPE_CHECKING:
    from tracker.parameters import RunParameters


@dataclass(frozen=True, slots=True, eq=False)
class SequentialPhdState:
    """The posterior of the step before, the first label that is still free, and who is lost."""

    mixture: GaussianMixture
    next_label: int
    memory: Memory
    recent: Recent = ()
    """What each camera left unexplained in the last frames."""


@dataclass(slots=True, eq=False)
class _Work:
    """One step while the cameras update it one after another."""

    mixture: GaussianMixture
    record: Record
    next_label: int
    births: range
    """Labels of this step's births."""
    sure: dict[int, float]
    """Predicted weight of each label, where it is enough to hide others."""
    measured: list[Measurements]
    """The boxes of each camera as measurements."""
    unexplained: list[ndarray]
    """What nobody explains of each camera's boxes."""
    ledger: Ledger


class SequentialPhd:
    """Fusion by the sequential-sensor GM-PHD filter ([ZW21] §2.4).

    The intensity is predicted once, with births; then camera 1's boxes update it,
    the result is the prior for camera 2, and so on. The published scheme takes the
    centre of a box, a random walk of (x, y, z), births at the entrances only, one
    p_D inside the picture and the plain recursion of camera after camera; each is
    one value of a parameter, and the ``published`` preset sets them all.
    """

    def __init__(self, sequence: Sequence, parameters: RunParameters) -> None:
        self._parameters = parameters.fusion
        self._model = FusionModel(sequence, parameters.fusion)

    def start(self) -> SequentialPhdState:
        """Nobody is in the room."""
        dimension = self._model.motion.dimension
        return SequentialPhdState(GaussianMixture.empty(dimension), 1, Memory.start(dimension))

    def step(
        self,
        state: SequentialPhdState,
        views: Many[ViewResult],
        told: PlaceConstraints | None = None,
    ) -> tuple[SequentialPhdState, FusionResult]:
        """Predict one step ahead and update with every camera's boxes, in the cameras' order."""
        p = self._parameters
        mixture = self._model.motion.predict(state.mixture, p.survival_probability)
        # components are heaviest first; read from the end, a label keeps its heaviest one's place
        previous = dict(zip(mixture.labels[::-1].tolist(), mixture.means[::-1, :3], strict=True))
        sure = _confirmed_labels(mixture)
        next_label = state.next_label
        if p.birth != "measurements":
            births = models.label_births(self._model.births, next_label)
            next_label += births.size
            mixture = gaussian_mixture.concatenate([mixture, births])
        work = _Work(
            mixture,
            Record.blank(len(views), mixture.size),
            next_label,
            range(state.next_label, next_label),
            sure,
            measured=[],
            unexplained=[],
            ledger=Ledger(),
        )
        for index, view in enumerate(views):
            self._update(work, index, view)
        recent = state.recent
        if p.birth != "entrances":
            recent = self._add_newborns(work, views, recent)
        if told is not None:
            mixture, record, work.next_label = obey(
                work.mixture, work.record, told, self._model,
                first_new_label=state.next_label, next_label=work.next_label,
            )  # fmt: skip
            heaviest_first = np.argsort(-mixture.weights, kind="stable")
            work.mixture, work.record = mixture.take(heaviest_first), record.take(heaviest_first)
        inside = self._model.stays(work.mixture)
        mixture, record = work.mixture.take(inside), work.record.take(inside)
        if p.misses == "per_person":
            single = self._without_duplicates(mixture, record)
            mixture, record = mixture.take(single), record.take(single)
        associations = work.ledger.associations(mixture.labels)
        labels, next_label = _one_person_a_label(mixture, previous, work.next_label)
        mixture = _relabelled(mixture, labels)
        labels, lost = memory.recall(state.memory, mixture, self._model, state.next_label)
        mixture = _relabelled(mixture, labels)
        after = SequentialPhdState(mixture, next_label, lost, recent)
        return after, record.result(mixture, associations)

    def _update(self, work: _Work, index: int, view: ViewResult) -> None:
        """The update by the boxes of one camera, and its reduction."""
        p, model, mixture = self._parameters, self._model, work.mixture
        measurements = model.target.measured(view, p.measurement_sigma)
        if view.blind:
            work.measured.append(measurements)
            work.unexplained.append(np.zeros(0))
            return
        expected = model.expected(index, mixture)
        seen = model.visible(index, expected, mixture, _occluders(mixture, work.sure))
        updated = phd.update(
            mixture,
            measurements.values,
            expected=expected.expected,
            noise=measurements.noises,
            detection_probability=seen.detection_probabilities,
            clutter_intensity=model.clutter[index] * view.clutter_factors,
            gate=model.gate,
        )
        owners = None
        if p.misses == "per_person":
            updated = one_person.share_boxes(
                mixture,
                updated,
                seen.detection_probabilities,
                births=work.births,
                next_label=work.next_label,
            )
            work.next_label += len(measurements.values)
            owners = one_person.owners(updated.posterior)
        posterior, parents, sources = updated.posterior, updated.parents, updated.measurements
        record = work.record.take(parents)
        record.detection_probabilities[index] = seen.detection_probabilities[parents]
        record.hidden_by[index] = seen.hidden_by[parents]
        record.sources[index] = sources
        record.source_weights[index] = np.where(sources >= 0, posterior.weights, 0.0)
        pairs = slice(mixture.size, None)
        work.ledger.add(index, posterior.labels[pairs], sources[pairs], posterior.weights[pairs])
        work.mixture, leaders = gaussian_mixture.reduce(
            posterior,
            pruning_threshold=p.pruning_threshold,
            merging_threshold=p.merging_threshold,
            max_components=p.max_components,
            owners=owners,
        )
        work.record = record.take(leaders)
        work.measured.append(measurements)
        work.unexplained.append(1.0 - updated.measurement_weights)

    def _add_newborns(self, work: _Work, views: Many[ViewResult], recent: Recent) -> Recent:
        """Components where unexplained boxes of several cameras agree on a place; what is to be
        remembered of this step's frames."""
        measured = Measurements(
            np.concatenate([each.values for each in work.measured]),
            np.concatenate([each.noises for each in work.measured]),
        )
        seen = all_boxes(views)
        unexplained = np.concatenate(work.unexplained)
        evidence = Evidence(
            seen.boxes[:, :2], measured, unexplained, seen.starts, seen.clutter_factors
        )
        found, later = self._model.newborns_and_recent(evidence, seen.boxes, views, recent)
        if found is None:
            return later
        born, newborns = found
        born = models.label_births(born, work.next_label)
        work.next_label += born.size
        first = work.mixture.size
        work.mixture = gaussian_mixture.concatenate([work.mixture, born])
        work.record = work.record.extended(born.size)
        work.record.sources[:, first:] = newborns.sources
        work.record.source_weights[:, first:] = newborns.sources >= 0
        cameras = missing_frames.seeing(views)
        seeing = slice(None) if cameras is None else cameras
        work.record.detection_probabilities[seeing, first:] = self._parameters.detection_probability
        return later

    def _without_duplicates(self, mixture: GaussianMixture, record: Record) -> Int[ndarray, " K"]:
        """Indices of the components of those labels that do not only repeat another."""
        grouped = linear_algebra.group_labels(mixture.labels)
        labels, label = grouped.labels, grouped.places
        held = np.bincount(label, mixture.weights, len(labels))
        # the heaviest component of a label says where its person is
        heaviest = mixture_kernels.heaviest_of_groups(mixture.weights, label, len(labels))
        duplicate = self._model.duplicates(
            mixture.means[heaviest], held, labels, record.sources[:, heaviest]
        )
        return np.flatnonzero(~duplicate[label])


def _relabelled(mixture: GaussianMixture, labels: Int[ndarray, " J"]) -> GaussianMixture:
    """The same components under other labels."""
    return GaussianMixture(mixture.weights, mixture.means, mixture.covariances, labels)


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
