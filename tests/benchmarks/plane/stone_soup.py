"""Stone Soup's GM-PHD filter in its fastest configuration: k-d trees for gate and merging."""

# mypy: disable-error-code="import-untyped"

from __future__ import annotations

from datetime import datetime, timedelta
from typing import Any

import numpy as np
from numpy import ndarray
from stonesoup.hypothesiser.distance import DistanceHypothesiser
from stonesoup.hypothesiser.gaussianmixture import GaussianMixtureKDTreeHypothesiser
from stonesoup.measures import Mahalanobis
from stonesoup.mixturereducer.gaussianmixture import GaussianMixtureReducer
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.models.transition.linear import LinearGaussianTimeInvariantTransitionModel
from stonesoup.predictor.kalman import KalmanPredictor
from stonesoup.types.detection import Detection
from stonesoup.types.state import TaggedWeightedGaussianState
from stonesoup.updater.kalman import KalmanUpdater
from stonesoup.updater.pointprocess import PHDUpdater

from tests.benchmarks.plane.filters import GATE, HALF
from tests.benchmarks.plane.scenario import (
    DETECTION,
    MERGING,
    MOTION_NOISE,
    NOISE,
    PRUNING,
    START,
    SURVIVAL,
    TRANSITION,
    Scenario,
)

LOOKED_AT = 80.0
"""Metres around a predicted place in which its k-d tree looks for measurements: the gate."""

MERGED_WITHIN = 40.0
"""Metres around a component in which its k-d tree looks for others to merge."""

_BEGIN = datetime(2000, 1, 1)


class StoneSoupPhd:
    """The library's own parts, put together as its tutorial does, with the trees switched on."""

    def __init__(self, case: Scenario) -> None:
        self._case = case
        self._time = _BEGIN
        self._sensor = LinearGaussian(4, (0, 2), NOISE)
        motion = LinearGaussianTimeInvariantTransitionModel(
            transition_matrix=TRANSITION, covariance_matrix=MOTION_NOISE
        )
        predictor, updater = KalmanPredictor(motion), KalmanUpdater(self._sensor)
        self._hypothesiser = GaussianMixtureKDTreeHypothesiser(
            hypothesiser=DistanceHypothesiser(
                predictor, updater, Mahalanobis(), missed_distance=float(np.sqrt(GATE))
            ),
            predictor=predictor,
            updater=updater,
            max_distance=LOOKED_AT,
            order_by_detection=True,
        )
        self._updater = PHDUpdater(
            updater,
            clutter_spatial_density=case.clutter_intensity,
            prob_detection=DETECTION,
            prob_survival=SURVIVAL,
        )
        self._reducer = GaussianMixtureReducer(
            prune_threshold=PRUNING,
            merge_threshold=MERGING,
            max_number_components=case.most_components,
            kdtree_max_distance=MERGED_WITHIN,
        )
        self._components: list[Any] = [
            self._state(mean, 1.0, f"first {number}") for number, mean in enumerate(case.first)
        ]

    def _state(self, mean: ndarray, weight: float, tag: str) -> TaggedWeightedGaussianState:
        return TaggedWeightedGaussianState(
            mean[:, None], START.copy(), timestamp=self._time, weight=weight, tag=tag
        )

    def step(self, scan: ndarray) -> None:
        """One step: its updater takes births and survivors alike, so births come at its p_S."""
        self._time += timedelta(seconds=1)
        detections = {
            Detection(z[:, None], timestamp=self._time, measurement_model=self._sensor)
            for z in scan
        }
        births = [
            self._state(mean, self._case.birth_weight / SURVIVAL, f"{self._time} {number}")
            for number, mean in enumerate(self._case.births)
        ]
        hypotheses = self._hypothesiser.hypothesise(
            [*self._components, *births], detections, self._time
        )
        updated = self._updater.update(hypotheses)
        self._components = list(self._reducer.reduce(list(updated)))

    def places(self, rule: str) -> ndarray:
        """By ``components``."""
        heavy = [part for part in self._components if part.weight > HALF]
        return np.array([np.asarray(part.mean, dtype=float).ravel()[[0, 2]] for part in heavy])
