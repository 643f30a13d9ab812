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
from scipy.stats import chi2

from tracker import gaussian_mixture, models, phd
from tracker.camera import Camera
from tracker.fusion.protocol import FusionResult
from tracker.gaussian_mixture import GaussianMixture
from tracker.parameters import FusionParams
from tracker.sequences.sequence import Sequence
from tracker.single_view.protocol import ViewResult

CONFIRMED_WEIGHT = 0.5
"""A component heavier than this stands for a person, so no second one may bear its label."""


@dataclass(frozen=True, slots=True, eq=False)
class SequentialPhdState:
    """The posterior of the step before, and the first label that is still free."""

    mixture: GaussianMixture
    next_label: int


@dataclass(frozen=True, slots=True, eq=False)
class _Evidence:
    """What each camera said of each component; carried through update and merging."""

    detection_probabilities: Float[ndarray, "C J"]
    sources: Int[ndarray, "C J"]
    source_weights: Float[ndarray, "C J"]

    @staticmethod
    def none(cameras: int, size: int) -> _Evidence:
        return _Evidence(
            np.zeros((cameras, size)),
            np.full((cameras, size), -1, dtype=np.int64),
            np.zeros((cameras, size)),
        )

    def take(self, indices: ndarray) -> _Evidence:
        return _Evidence(
            self.detection_probabilities[:, indices],
            self.sources[:, indices],
            self.source_weights[:, indices],
        )


class SequentialPhd:
    """Fusion by the sequential-sensor GM-PHD filter ([ZW21] §2.4).

    State (x, y, z) in metres, random walk. The intensity is predicted once, with
    births at the entrances; then camera 1's boxes update it, the result is the
    prior for camera 2, and so on. The measurement is the centre of a box,
    through the calibrated camera with its lens, linearised at each component.
    """

    def __init__(self, sequence: Sequence, parameters: FusionParams) -> None:
        self._parameters = parameters
        self._cameras = sequence.cameras
        self._noise = models.random_walk_noise(parameters.motion_sigma, sequence.step_time, 3)
        self._births = models.entrance_births(
            sequence.room, parameters.birth_rate * sequence.step_time
        )
        self._clutter = [
            parameters.clutter_rate / models.visible_area(camera, sequence.room)
            for camera in self._cameras
        ]
        self._gate = float(chi2.ppf(parameters.gate_probability, df=2))

    def start(self) -> SequentialPhdState:
        """Nobody is in the room."""
        return SequentialPhdState(GaussianMixture.empty(3), next_label=1)

    def step(
        self, state: SequentialPhdState, views: Many[ViewResult]
    ) -> tuple[SequentialPhdState, FusionResult]:
        """Predict one step ahead and update with every camera's boxes, in the cameras' order."""
        survivors = gaussian_mixture.predict(
            state.mixture, np.eye(3), self._noise, self._parameters.survival_probability
        )
        births = models.label_births(self._births, state.next_label)
        mixture = gaussian_mixture.concatenate([survivors, births])
        next_label = state.next_label + births.size
        previous = dict(zip(survivors.labels.tolist(), survivors.means, strict=True))

        evidence = _Evidence.none(len(self._cameras), mixture.size)
        for index, (camera, view) in enumerate(zip(self._cameras, views, strict=True)):
            mixture, evidence = self._update(mixture, evidence, index, camera, view)
        labels, next_label = _one_person_a_label(mixture, previous, next_label)
        mixture = GaussianMixture(mixture.weights, mixture.means, mixture.covariances, labels)
        result = FusionResult(
            posterior=mixture,
            detection_probabilities=evidence.detection_probabilities,
            sources=evidence.sources,
            source_weights=evidence.source_weights,
            hidden_by=np.full(evidence.sources.shape, -1, dtype=np.int64),
        )
        return SequentialPhdState(mixture, next_label), result

    def _update(
        self,
        mixture: GaussianMixture,
        evidence: _Evidence,
        index: int,
        camera: Camera,
        view: ViewResult,
    ) -> tuple[GaussianMixture, _Evidence]:
        expected, jacobians, valid = camera.project_with_jacobian(mixture.means)
        probability = self._parameters.detection_probability * (valid & camera.contains(expected))
        noise = np.zeros((len(view.boxes), 2, 2))
        noise[:, [0, 1], [0, 1]] = (self._parameters.measurement_sigma * view.sigmas[:, :2]) ** 2
        updated = phd.update(
            mixture,
            view.boxes[:, :2],
            expected=np.where(valid[:, None], expected, 0.0),
            jacobians=jacobians,
            noise=noise,
            detection_probability=probability,
            clutter_intensity=self._clutter[index],
            gate=self._gate,
        )
        evidence = evidence.take(updated.parents)
        evidence.detection_probabilities[index] = probability[updated.parents]
        evidence.sources[index] = updated.measurements
        evidence.source_weights[index] = np.where(
            updated.measurements >= 0, updated.posterior.weights, 0.0
        )
        reduced, leaders = gaussian_mixture.reduce(
            updated.posterior,
            pruning_threshold=self._parameters.pruning_threshold,
            merging_threshold=self._parameters.merging_threshold,
            max_components=self._parameters.max_components,
        )
        return reduced, evidence.take(leaders)


def _one_person_a_label(
    mixture: GaussianMixture, previous: dict[int, ndarray], next_label: int
) -> tuple[Int[ndarray, " J"], int]:
    """Give a new label to every confirmed component but one that shares a label.

    The one nearest to where the label was predicted keeps it: two people who
    were born as one component go on as two tracks from the step they part.
    """
    labels = mixture.labels.copy()
    confirmed = np.flatnonzero(mixture.weights > CONFIRMED_WEIGHT)
    for label in np.unique(labels[confirmed]).tolist():
        bearers = confirmed[labels[confirmed] == label]
        if len(bearers) < 2:
            continue
        place = previous.get(label, mixture.means[bearers[0]])
        distances = np.linalg.norm(mixture.means[bearers] - place, axis=1)
        for other in np.delete(bearers, int(np.argmin(distances))):
            labels[other] = next_label
            next_label += 1
    return labels, next_label
