"""One cluster of targets and measurements, for our association and for Stone Soup's."""

# mypy: disable-error-code="import-untyped"

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import Any

import numpy as np
from numpy import ndarray
from stonesoup.dataassociator.probability import JPDA, JPDAwithEHM2
from stonesoup.hypothesiser.probability import PDAHypothesiser
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.models.transition.linear import (
    CombinedLinearGaussianTransitionModel,
    ConstantVelocity,
)
from stonesoup.predictor.kalman import KalmanPredictor
from stonesoup.types.detection import Detection
from stonesoup.types.state import GaussianState
from stonesoup.types.track import Track
from stonesoup.updater.kalman import KalmanUpdater

DETECTION, GATE, CLUTTER = 0.9, 0.999, 1e-3
"""P_D; the probability of a gate; expected false measurements a unit of area."""

NOW = datetime(2000, 1, 1)


@dataclass(frozen=True, eq=False)
class Cluster:
    """Targets close together, with their measurements and a false one."""

    tracks: list[Any]
    detections: list[Any]
    missed: ndarray
    detected: ndarray
    unexplained: ndarray

    def stone_soup(self, associator: Any) -> ndarray:
        """Its marginals: (n, 1 + M), the miss first."""
        result = associator.associate(set(self.tracks), set(self.detections), NOW)
        table = np.zeros((len(self.tracks), 1 + len(self.detections)))
        for i, track in enumerate(self.tracks):
            for hypothesis in result[track]:
                j = 1 + self.detections.index(hypothesis.measurement) if hypothesis else 0
                table[i, j] += float(hypothesis.probability)
        return table


def cluster(targets: int, seed: int, *, spread: float = 1.5) -> Cluster:
    """n targets within ``spread`` standard deviations of noise, n + 1 measurements of them."""
    rng = np.random.default_rng(seed)
    places = rng.normal(0.0, spread, (targets, 2))
    measurements = np.vstack([places, np.zeros((1, 2))]) + rng.normal(0.0, 1.0, (targets + 1, 2))
    sensor = LinearGaussian(4, (0, 2), np.eye(2))
    covariance = np.diag([1.0, 0.5, 1.5, 0.5])
    tracks = [
        Track([GaussianState([x, 0.1, y, -0.1], covariance, timestamp=NOW)]) for x, y in places
    ]
    detections = [
        Detection(z[:, None], timestamp=NOW, measurement_model=sensor) for z in measurements
    ]
    innovation = np.array([2.0, 2.5])  # no time passes: the state's covariance and the noise
    offsets = measurements[None] - places[:, None]
    squared = (offsets**2 / innovation).sum(axis=2)
    density = np.exp(-0.5 * squared) / (2.0 * np.pi * np.sqrt(innovation.prod()))
    inside = squared <= -2.0 * np.log(1.0 - GATE)  # χ² of two degrees of freedom
    return Cluster(
        tracks,
        detections,
        missed=np.full(targets, 1.0 - DETECTION * GATE),
        detected=DETECTION * density * inside,
        unexplained=np.full(targets + 1, CLUTTER),
    )


def associators() -> dict[str, Any]:
    """Stone Soup's, by name, with the same numbers."""
    motion = CombinedLinearGaussianTransitionModel([ConstantVelocity(0.1), ConstantVelocity(0.1)])
    hypothesiser = PDAHypothesiser(
        KalmanPredictor(motion),
        KalmanUpdater(None),
        clutter_spatial_density=CLUTTER,
        prob_detect=DETECTION,
        prob_gate=GATE,
    )
    hypothesiser = _Remembering(hypothesiser)
    return {"JPDA": JPDA(hypothesiser), "EHM2": JPDAwithEHM2(hypothesiser)}


class _Remembering:
    """Gives the hypotheses of a track again, so that a benchmark times the association alone."""

    def __init__(self, hypothesiser: Any) -> None:
        self._hypothesiser = hypothesiser
        self._known: dict[str, Any] = {}  # by the tracks' own names: an address is given again

    def hypothesise(self, track: Any, detections: Any, timestamp: datetime) -> Any:
        """Those of the first time that the track was asked for."""
        if track.id not in self._known:
            self._known[track.id] = self._hypothesiser.hypothesise(track, detections, timestamp)
        return self._known[track.id]
