"""Tracking in one camera by joint probabilistic data association, with five cases.

[WW10] Wang, Wan, "Fast tracking of multiple targets in video by joint probabilistic
data association", patent CN101783020A, 2010.
[FBS83] Fortmann, Bar-Shalom, Scheffe, "Sonar tracking of multiple targets using joint
probabilistic data association", IEEE Journal of Oceanic Engineering 8(3), 1983.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8
from numpy import ndarray
from scipy.special import gammaln

from tracker.filters import association
from tracker.filters.association import MOST_ITEMS, Marginals
from tracker.filters.gaussian_mixture import gate_distance
from tracker.parameters.groups.jpda import JpdaParams
from tracker.sequences.pictures.frames import Pictures
from tracker.sequences.sequence import Sequence
from tracker.single_view.jpda.cases import (
    Cases,
    CaseUpdates,
    determine_cases,
    exclude_outside_boxes,
    search_components,
    update_by_case,
)
from tracker.single_view.jpda.measurements import Measured, Source, source_of
from tracker.single_view.jpda.targets import Innovations, Managed, Targets, innovations, manage
from tracker.single_view.pictures.background import pack
from tracker.single_view.protocol import ViewEvent, ViewResult, pack_samples

if TYPE_CHECKING:
    from tracker.parameters.catalogue import RunParameters


def associate(
    found: Innovations,
    possible: Bool[ndarray, "n M"],
    area: float,
    parameters: JpdaParams,
) -> tuple[Float[ndarray, "n M"], Int[ndarray, " n"]]:
    """Compute association probabilities β_tj, and the likeliest joint event.

    By Bayes' rule a joint event has the weight Π_t P_D Λ_tj or 1 − P_D P_G, times

    * **poisson**: λ_c / area for each false measurement;
    * **diffuse**, as published: Φ! / V^Φ, for an unknown number Φ. V is the area of the ellipse
      that is a gate with P_G, π γ √|S| ([FBS83]_); so that it is one number for all gates, it is
      in units of √|S|, as is then Λ.

    Groups of targets that share no measurement are independent.

    Args:
        found: Innovations of all targets and measurements.
        possible: Whether each measurement is in the gate of each target.
        area: Area of the image, square pixels.
        parameters: P_D, P_G, the kind of joint events, and the model of Φ.

    Returns:
        β_tj, and the measurement of each target in the likeliest joint event, -1 for none.
    """
    p = parameters
    targets, count = possible.shape
    matrix = np.zeros((targets, count))
    own = np.full(targets, -1, dtype=np.int64)
    densities, clutter = found.densities, p.clutter_rate / area
    if p.clutter == "diffuse":
        densities = densities * np.sqrt(np.linalg.det(found.covariances))
        clutter = 1.0 / (np.pi * gate_distance(p.gate_probability, 2))
    detected = np.where(possible, p.detection_probability * densities, 0.0)
    # a density may underflow to 0 inside its gate; the pair remains possible
    detected[possible] = np.maximum(detected[possible], np.finfo(float).tiny)
    miss = 1.0 - p.detection_probability * p.gate_probability
    for members, shared in association.clusters(possible):
        if not len(shared):
            continue
        part = np.ix_(members, shared)
        weights = (np.full(len(members), miss), detected[part], np.full(len(shared), clutter))
        matrix[part] = _marginals(*weights, p).detected
        sources = association.murty(*weights, 1).sources[0]
        own[members[sources[sources >= 0]]] = shared[sources >= 0]
    return matrix, own


def _marginals(
    missed: Float[ndarray, " n"],
    detected: Float[ndarray, "n M"],
    unexplained: Float[ndarray, " M"],
    p: JpdaParams,
) -> Marginals:
    """Compute the association probabilities by the chosen method.

    Args:
        missed: Factor of the joint probability if a target has no measurement.
        detected: Factor of the joint probability of each pair of a target and a measurement.
        unexplained: Factor of the joint probability if a measurement is false.
        p: The parameters.
    """
    count = len(unexplained)
    false_counts = np.exp(gammaln(np.arange(count + 1) + 1.0)) if p.clutter == "diffuse" else None
    if p.association == "exact":
        if min(detected.shape) <= MOST_ITEMS:
            return association.exact_marginals(
                missed, detected, unexplained, false_counts=false_counts
            )
        return association.marginals(missed, detected, unexplained)
    if p.association == "murty":
        events = association.murty(missed, detected, unexplained, p.events)
    else:
        events = association.simplified_murty(missed, detected, unexplained)
    weights = association.log_weights(
        events, missed, detected, unexplained, false_counts=false_counts
    )
    return association.marginals_of(events, weights)


BELIEVED = 0.5
"""Probability above which a measurement belongs to a target: more likely than not."""


@dataclass(frozen=True, slots=True, eq=False)
class JpdaState:
    """The targets after a step, and all that the next step needs."""

    targets: Targets
    """The present targets."""
    vanished: Targets
    """Targets that vanished recently; their misses count since the last measurement."""
    next_label: int
    """The first label that is free."""
    source: Any
    """The state of the source of measurements."""


class Jpda:
    """Kalman filters with joint probabilistic data association ([WW10]_).

    State [p_x, v_x, p_y, v_y], constant velocity, measured at the position; the box's
    size is smoothed separately. Per step: the validation matrix has the gated pairs;
    joint events, and Bayes' rule for each, give the association matrix β; its rows and
    columns determine five cases (:func:`~tracker.single_view.jpda.cases.determine_cases`):

    * normal and split targets are updated by the mean over all associations;
    * occluded ones are put at the measurement with velocity 0, or, beyond the patent,
      predicted inside the foreground component that occludes them;
    * a target without measurement is predicted, and has vanished after three steps;
    * a measurement without target is compared with the targets that vanished in the last
      steps, and else begins a target; both have velocity 0.

    Without the five cases this is the classical filter: targets begin at measurements outside
    all gates, end without measurements, and all others are updated by the mean.
    """

    def __init__(
        self,
        sequence: Sequence,
        camera_index: int,
        parameters: RunParameters,
        reader: Pictures,
        source: Source | None = None,
    ) -> None:
        """Prepare the filter of one camera.

        Args:
            sequence: The sequence.
            camera_index: Index of the camera.
            parameters: Parameters of the association and of the measurements.
            reader: Reader of the images.
            source: The source of measurements of another method, whose targets are followed with
                the default parameters; None for what the parameters say.

        Raises:
            ValueError: If the camera lacks data for the measurements.
        """
        self._parameters = p = parameters.of(JpdaParams) if source is None else JpdaParams()
        self._source = source or source_of(sequence, camera_index, parameters, reader)
        self._step_time = sequence.step_time
        self._longest_hidden = max(1, round(p.longest_hidden * sequence.fps))
        self._gate = gate_distance(p.gate_probability, 2)
        width, height = sequence.cameras[camera_index].image_size
        self._area = float(width * height)

    def start(self) -> JpdaState:
        """The state without targets, before the first step."""
        return JpdaState(Targets.empty(), Targets.empty(), 1, self._source.start())

    def step(
        self,
        state: JpdaState,
        frame: int,
        picture: UInt8[ndarray, "h w 3"] | None,
        rng: np.random.Generator,
    ) -> tuple[JpdaState, ViewResult]:
        """Process one step; without an image the targets are predicted only."""
        p = self._parameters
        expected = state.targets.predict(self._step_time, p.acceleration_sigma)
        vanished = state.vanished.predict(self._step_time, p.acceleration_sigma)
        vanished = replace(vanished, misses=vanished.misses + 1)
        boxes = expected.as_boxes(self._source.sigmas(expected.boxes))
        source, seen = self._source.measure(state.source, frame, picture, boxes, rng)
        found = innovations(expected, seen.boxes[:, :2], seen.sigmas[:, :2])
        possible = found.squared <= self._gate
        matrix, own = associate(found, possible, self._area, p)
        cases, matrix = self._cases(expected, matrix, own, seen)
        updated = update_by_case(expected, found, matrix, cases, seen, p)
        managed = manage(
            updated.targets,
            vanished,
            state.next_label,
            cases.new,
            seen,
            p,
            gate=self._gate,
            longest_hidden=self._longest_hidden,
        )
        result = self._result(expected, seen, cases, updated, managed)
        return JpdaState(managed.targets, managed.vanished, managed.next_label, source), result

    def _cases(
        self, expected: Targets, matrix: ndarray, own: ndarray, seen: Measured
    ) -> tuple[Cases, ndarray]:
        """Determine the case of each target, and the matrix after this."""
        p = self._parameters
        if not p.five_cases:
            cases = determine_cases(matrix, own, 0.0, every_shared_row=False)
            none = np.zeros(expected.size, dtype=bool)
            return replace(cases, shared=np.full(expected.size, -1), split=none), matrix
        inside = p.occlusion == "inside"
        cases = determine_cases(matrix, own, p.least_probability, every_shared_row=not inside)
        if inside:
            cases, matrix = exclude_outside_boxes(cases, matrix, expected.boxes, seen.boxes)
            cases = search_components(cases, expected.boxes, seen.boxes, seen.pieces, p.leap)
        return cases, matrix

    def _result(
        self,
        expected: Targets,
        seen: Measured,
        cases: Cases,
        updated: CaseUpdates,
        managed: Managed,
    ) -> ViewResult:
        """Return the result of a step."""
        p, targets = self._parameters, managed.targets
        # returned and new targets are at their measurements
        arrived = np.ones(len(managed.sources))
        weights = np.concatenate([_weights(updated, cases)[managed.stayed], arrived])
        counting = targets.labels > 0
        shown = np.flatnonzero(counting)
        estimates = targets.boxes[shown]
        if p.output == "measurements":
            boxes, sigmas, box_weights, labels = self._believed(seen, updated, managed)
        else:
            seen_now = counting & (targets.misses == 0)
            if p.occlusion == "inside":
                seen_now &= targets.hidden == 0  # the position of an occluded target is uncertain
            chosen = np.flatnonzero(seen_now)
            boxes, box_weights = targets.boxes[chosen], weights[chosen]
            sigmas, labels = self._source.sigmas(boxes), targets.labels[chosen]
        return ViewResult(
            boxes=boxes,
            weights=box_weights,
            labels=labels,
            sigmas=sigmas,
            estimates=estimates,
            estimate_weights=weights[shown],
            estimate_labels=targets.labels[shown],
            measurements=seen.boxes if seen.shown is None else seen.shown,
            measurement_scores=seen.scores if seen.shown_scores is None else seen.shown_scores,
            samples=pack_samples(seen.samples, seen.sample_weights),
            information={**seen.information, "newcomers": float((~counting).sum())},
            dropped=seen.dropped,
            events=_events(expected, cases, updated, managed),
            gates=self._gates(expected),
            foreground=None if seen.mask is None else pack(seen.mask),
        )

    def _believed(
        self, seen: Measured, updated: CaseUpdates, managed: Managed
    ) -> tuple[ndarray, ndarray, ndarray, ndarray]:
        """The measurements that belong to targets: boxes, sigmas, probabilities and labels."""
        after = len(managed.targets.labels)
        matrix = np.zeros((after, len(seen.boxes)))
        matrix[: len(managed.stayed)] = updated.matrix[managed.stayed]
        matrix[np.arange(len(managed.stayed), after), managed.sources] = 1.0
        counting = managed.targets.labels > 0
        matrix, labels = matrix[counting], managed.targets.labels[counting]
        explained = matrix.sum(axis=0)
        believed = np.flatnonzero(explained > BELIEVED)
        if not len(believed):
            return seen.boxes[:0], seen.sigmas[:0], np.zeros(0), np.zeros(0, dtype=np.int64)
        whose = labels[matrix[:, believed].argmax(axis=0)]
        return (
            seen.boxes[believed],
            seen.sigmas[believed],
            np.minimum(explained[believed], 1.0),
            whose,
        )

    def _gates(self, expected: Targets) -> ndarray:
        """The gates of measurements with the targets' own sizes."""
        counting = expected.take(np.flatnonzero(expected.labels > 0))
        noise = self._source.sigmas(counting.boxes)[:, :2] ** 2
        spread = counting.place_covariances + noise[:, :, None] * np.eye(2)
        border = self._gate * spread[:, [0, 0, 1], [0, 1, 1]]
        return np.concatenate([counting.positions, border], axis=1)


def _weights(updated: CaseUpdates, cases: Cases) -> ndarray:
    """The probability that each target was measured; that of occluded targets is unknown."""
    weights = np.minimum(updated.matrix.sum(axis=1), 1.0)
    return np.where(updated.hidden, 0.5, weights)


def _events(
    expected: Targets, cases: Cases, updated: CaseUpdates, managed: Managed
) -> tuple[ViewEvent, ...]:
    """The events of the step; new targets that are not confirmed yet have none."""
    labels = expected.labels
    events = []
    for j in np.unique(cases.shared[cases.shared >= 0]):
        group = np.flatnonzero((cases.shared == j) & (labels > 0))
        if len(group) > 1 and updated.hidden[group].any():
            events.append(ViewEvent("occluded", tuple(sorted(labels[group].tolist()))))
    for label in labels[cases.split & (labels > 0)].tolist():
        events.append(ViewEvent("split", (label,)))
    for label in managed.vanished_labels:
        events.append(ViewEvent("vanished", (label,)))
    for label in managed.returned_labels:
        events.append(ViewEvent("returned", (label,)))
    for label in managed.new_labels:
        events.append(ViewEvent("new", (label,)))
    return tuple(events)
