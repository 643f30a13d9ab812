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

from tracker.filters import association, gaussian_mixture, models, phd
from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.filters.phd import PhdUpdate
from tracker.fusion import memory, missing_frames
from tracker.fusion.constraint_update import apply_constraints
from tracker.fusion.measurement_births import Evidence
from tracker.fusion.memory import Memory
from tracker.fusion.missing_frames import Recent
from tracker.fusion.model import CONFIRMED, FusionModel, all_boxes
from tracker.fusion.protocol import FusionResult, PlaceConstraints
from tracker.fusion.record import Ledger, Record
from tracker.kernels import bernoulli, linear_algebra
from tracker.kernels import mixtures as mixture_kernels
from tracker.kernels.bernoulli import LabelledWeights, PairOdds
from tracker.kernels.kalman import Measurements
from tracker.sequences.sequence import Sequence
from tracker.single_view.protocol import ViewResult

if TYPE_CHECKING:
    from tracker.parameters.catalogue import RunParameters

_LARGEST_LOG_ODDS = 600.0
"""Bound at which log odds are clipped, so that their exponential does not overflow, which it does
from 709.8 on."""


@dataclass(frozen=True, slots=True, eq=False)
class SequentialPhdState:
    """The posterior of a step and all that the next step needs of it."""

    mixture: GaussianMixture
    """The intensity; components that share a label are one track."""
    next_label: int
    """The first label that is free."""
    memory: Memory
    """The confirmed tracks and those lost a short while ago."""
    recent: Recent = ()
    """Unexplained boxes of the last frames, for cameras that have none at a step."""


@dataclass(slots=True, eq=False)
class _Work:
    """The mutable data of one step while the cameras update it one after another."""

    mixture: GaussianMixture
    """The intensity after the cameras so far."""
    record: Record
    """The evidence for its components."""
    next_label: int
    """The first label that is free."""
    births: range
    """Labels of this step's births."""
    confirmed: dict[int, float]
    """Predicted weight by label, of the confirmed labels, which may occlude others."""
    measured: list[Measurements]
    """The boxes of each camera as measurements."""
    unexplained: list[ndarray]
    """Probability of each camera's boxes that no target made them."""
    ledger: Ledger
    """Association probabilities so far."""


class SequentialPhd:
    """Fusion by the sequential-sensor GM-PHD filter ([ZW21] §2.4).

    The intensity is predicted once, with births; then camera 1's boxes update it,
    the result is the prior for camera 2, and so on. The published scheme measures the
    centre of a box and has a random walk of (x, y, z), births at the entrances only, one
    p_D inside the image and the plain recursion of camera after camera; each is
    one value of a parameter, and the ``published`` preset sets them all.

    The plain recursion takes targets as Poisson: a miss multiplies every weight by 1 − p_D
    whatever the cameras before detected, one component may explain two boxes, and two labels
    may share one target. With ``misses`` at ``per_person`` a label is one target instead, which
    exists with the sum of its components' weights; see :func:`associate_labels`.
    """

    def __init__(self, sequence: Sequence, parameters: RunParameters) -> None:
        """Prepare the filter for one sequence."""
        self._parameters = parameters.fusion
        self._model = FusionModel(sequence, parameters.fusion)

    def start(self) -> SequentialPhdState:
        """The state without tracks, before the first step."""
        dimension = self._model.motion.dimension
        return SequentialPhdState(GaussianMixture.empty(dimension), 1, Memory.start(dimension))

    def step(
        self,
        state: SequentialPhdState,
        views: Many[ViewResult],
        constraints: PlaceConstraints | None = None,
    ) -> tuple[SequentialPhdState, FusionResult]:
        """Predict one step ahead and update with every camera's boxes, in the cameras' order."""
        p = self._parameters
        mixture = self._model.motion.predict(state.mixture, p.survival_probability)
        # components are heaviest first: in reverse order the last entry of a label is its heaviest
        previous = dict(zip(mixture.labels[::-1].tolist(), mixture.means[::-1, :3], strict=True))
        confirmed = _confirmed_labels(mixture)
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
            confirmed,
            measured=[],
            unexplained=[],
            ledger=Ledger(),
        )
        for index, view in enumerate(views):
            self._update(work, index, view)
        recent = state.recent
        if p.birth != "entrances":
            recent = self._add_newborns(work, views, recent)
        if constraints is not None:
            mixture, record, work.next_label = apply_constraints(
                work.mixture, work.record, constraints, self._model,
                first_new_label=state.next_label, next_label=work.next_label,
            )  # fmt: skip
            heaviest_first = np.argsort(-mixture.weights, kind="stable")
            work.mixture, work.record = mixture.take(heaviest_first), record.take(heaviest_first)
        inside = self._model.inside_tracked_volume(work.mixture)
        mixture, record = work.mixture.take(inside), work.record.take(inside)
        if p.misses == "per_person":
            single = self._without_duplicates(mixture, record)
            mixture, record = mixture.take(single), record.take(single)
        associations = work.ledger.associations(mixture.labels)
        labels, next_label = _one_person_a_label(mixture, previous, work.next_label)
        mixture = _with_labels(mixture, labels)
        labels, lost = memory.recall(state.memory, mixture, self._model, state.next_label)
        mixture = _with_labels(mixture, labels)
        after = SequentialPhdState(mixture, next_label, lost, recent)
        return after, record.result(mixture, associations)

    def _update(self, work: _Work, index: int, view: ViewResult) -> None:
        """Update by the boxes of one camera, and reduce the mixture."""
        p, model, mixture = self._parameters, self._model, work.mixture
        measurements = model.target.measured(view.boxes, view.sigmas, p.measurement_sigma)
        if view.blind:
            work.measured.append(measurements)
            work.unexplained.append(np.zeros(0))
            return
        expected = model.expected(index, mixture)
        seen = model.visible(index, expected, mixture, _occluders(mixture, work.confirmed))
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
            updated = associate_labels(
                mixture,
                updated,
                seen.detection_probabilities,
                births=work.births,
                next_label=work.next_label,
            )
            work.next_label += len(measurements.values)
            owners = merging_owners(updated.posterior)
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
        """Append births where unexplained boxes of several cameras agree on a place.

        Returns:
            The recent evidence for the next step.
        """
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
        cameras = missing_frames.cameras_with_frame(views)
        seeing = slice(None) if cameras is None else cameras
        work.record.detection_probabilities[seeing, first:] = self._parameters.detection_probability
        return later

    def _without_duplicates(self, mixture: GaussianMixture, record: Record) -> Int[ndarray, " K"]:
        """Return the indices of the components whose labels are no duplicates of another label."""
        grouped = linear_algebra.group_labels(mixture.labels)
        labels, label = grouped.labels, grouped.places
        existences = np.bincount(label, mixture.weights, len(labels))
        # the position of a label is that of its heaviest component
        heaviest = mixture_kernels.heaviest_of_groups(mixture.weights, label, len(labels))
        duplicate = self._model.duplicates(
            mixture.means[heaviest], existences, labels, record.sources[:, heaviest]
        )
        return np.flatnonzero(~duplicate[label])


def _with_labels(mixture: GaussianMixture, labels: Int[ndarray, " J"]) -> GaussianMixture:
    """Return the components with other labels."""
    return GaussianMixture(mixture.weights, mixture.means, mixture.covariances, labels)


def _confirmed_labels(mixture: GaussianMixture) -> dict[int, float]:
    """The weight of each confirmed label."""
    heavy = mixture.weights > CONFIRMED
    return dict(zip(mixture.labels[heavy].tolist(), mixture.weights[heavy].tolist(), strict=True))


def _occluders(mixture: GaussianMixture, confirmed: dict[int, float]) -> Float[ndarray, " J"]:
    """Return the weight with which each component occludes others, 0 for most.

    Of each confirmed label only the heaviest component, which comes first, occludes others.
    """
    weights = np.zeros(mixture.size)
    left = dict(confirmed)
    for component, label in enumerate(mixture.labels.tolist()):
        weights[component] = left.pop(label, 0.0)
    return weights


def _one_person_a_label(
    mixture: GaussianMixture, previous: dict[int, ndarray], next_label: int
) -> tuple[Int[ndarray, " J"], int]:
    """Give new labels to all but one of the confirmed components that share a label.

    The component nearest to the predicted position of the label retains it: two people born as one
    component become two tracks at the step at which they separate.

    Args:
        mixture: J components, the heaviest first.
        previous: Predicted position of each label, world metres.
        next_label: The first label that is free.

    Returns:
        The labels of the J components, and the first label that is free afterwards.
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


def associate_labels(
    predicted: GaussianMixture,
    updated: PhdUpdate,
    detection_probability: Float[ndarray, " J"],
    *,
    births: range,
    next_label: int,
) -> PhdUpdate:
    """Recompute the weights so that each label makes at most one box, and each box has one label.

    With o_l(z) = Σ_{j∈l} p_j w_j q_j(z) / κ the odds of label l for box z, the
    association probabilities P(l ← z) and P(l misses) are the marginals of the
    one-to-one association with weights 1 − Σ_{j∈l} p_j w_j for a miss and o_l(z) for a
    box, by belief propagation. Then

        w_j(z) = P(l ← z) p_j w_j q_j(z) / (κ o_l(z))
        w_j ← w_j (1 − p_j) P(l misses) / (1 − Σ_{i∈l} p_i w_i)

    For one label alone that is Bayes' rule for existence, r' = r(1 − p)/(1 − r p) on
    a miss, which does not depend on the order of the cameras. Births of this step stay
    Poisson: they compete with the clutter, and a component updated by a box from them gets
    a label of its own.

    Args:
        predicted: J components before this camera.
        updated: The plain PHD update by the boxes of this camera.
        detection_probability: p_j of each component.
        births: The labels of this step's births.
        next_label: The first label that is free.

    Returns:
        The update with these weights and labels.
    """
    size, boxes = predicted.size, len(updated.measurement_weights)
    owner, box = updated.parents[size:], updated.measurements[size:]
    shared = bernoulli.share_boxes(
        LabelledWeights(predicted.weights, predicted.labels, detection_probability),
        births.start,
        births.stop,
        PairOdds(owner, box, updated.log_odds, boxes),
        _LARGEST_LOG_ODDS,
        association.CONVERGENCE,
    )
    labels = np.where(shared.of_people, predicted.labels[owner], next_label + box)
    posterior = GaussianMixture(
        np.concatenate([updated.posterior.weights[:size] * shared.factors, shared.shares]),
        updated.posterior.means,
        updated.posterior.covariances,
        np.concatenate([predicted.labels, labels]),
    )
    return PhdUpdate(
        posterior,
        updated.parents,
        updated.measurements,
        updated.log_odds,
        np.bincount(box, shared.shares, boxes),
    )


def merging_owners(mixture: GaussianMixture) -> Int[ndarray, " J"]:
    """Return the owner of each component for merging: its label if that is confirmed, else -1."""
    label = linear_algebra.group_labels(mixture.labels).places
    confirmed = np.bincount(label, mixture.weights) > CONFIRMED
    return np.asarray(np.where(confirmed[label], mixture.labels, -1))
