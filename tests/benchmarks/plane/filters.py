"""The filters that are set beside each other on :mod:`tests.benchmarks.plane.scenario`.

Each takes one scan after another and says where the targets are, by a rule: ``components``
reports every component above a half, ``W_z`` gathers by measurement.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy import ndarray
from scipy.stats import chi2

from tests.benchmarks.plane.scenario import (
    DETECTION,
    MERGING,
    MOTION_NOISE,
    NOISE,
    POSITION,
    PRUNING,
    START,
    SURVIVAL,
    TRANSITION,
    Scenario,
)
from tracker.filters import gaussian_mixture, phd, pmb
from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.kernels import linear_algebra
from tracker.kernels.kalman import Expected

GATE = float(chi2.ppf(0.9999, df=2))
"""Squared Mahalanobis distance: a target's own measurement lies inside with this probability."""

HALF = 0.5
"""Weight or existence probability above which a target is reported."""


class Filter(Protocol):
    """One filter on its way through a scenario."""

    def step(self, scan: ndarray) -> None:
        """Predict, update, reduce, and find what is to be reported."""
        ...

    def places(self, rule: str) -> ndarray:
        """Where the reported targets are (K, 2), after the last step."""
        ...


def _start(case: Scenario) -> tuple[GaussianMixture, GaussianMixture]:
    """The first targets and the births of every step."""
    count = len(case.births)
    births = GaussianMixture(
        np.full(count, case.birth_weight),
        case.births,
        np.tile(START, (count, 1, 1)),
        np.zeros(count, dtype=np.int64),
    )
    first = GaussianMixture(
        np.ones(case.targets),
        case.first,
        np.tile(START, (case.targets, 1, 1)),
        np.arange(case.targets),
    )
    return first, births


def _h(mixture: GaussianMixture) -> ndarray:
    return np.broadcast_to(POSITION, (mixture.size, 2, 4))


class Phd:
    """The engine's GM-PHD filter."""

    def __init__(self, case: Scenario) -> None:
        self._case = case
        self._mixture, self._births = _start(case)
        self._reported = self._mixture

    def step(self, scan: ndarray) -> None:
        """One step of the recursion and the extraction by measurement."""
        survivors = gaussian_mixture.predict(self._mixture, TRANSITION, MOTION_NOISE, SURVIVAL)
        predicted = gaussian_mixture.concatenate([survivors, self._births])
        updated = phd.update(
            predicted,
            scan,
            expected=Expected.of(predicted.means @ POSITION.T, POSITION[None]),
            noise=NOISE[None],
            detection_probability=DETECTION,
            clutter_intensity=self._case.clutter_intensity,
            gate=GATE,
        )
        self._reported = phd.extract_measured(predicted, updated, HALF)
        self._mixture, _ = gaussian_mixture.reduce(
            updated.posterior,
            pruning_threshold=PRUNING,
            merging_threshold=MERGING,
            max_components=self._case.most_components,
        )

    def places(self, rule: str) -> ndarray:
        """By ``components`` or ``W_z``."""
        reported = self._reported
        if rule == "components":
            reported = self._mixture.take(phd.extract(self._mixture, HALF))
        return reported.means[:, [0, 2]]


class Labelled:
    """The engine's Poisson multi-Bernoulli filter: one Gaussian, existence and label a target."""

    def __init__(self, case: Scenario) -> None:
        self._case = case
        self._tracks, self._births = _start(case)
        self._undetected = GaussianMixture.empty(4)
        self._next_label = case.targets

    def step(self, scan: ndarray) -> None:
        """One step of the recursion."""
        tracks = gaussian_mixture.predict(self._tracks, TRANSITION, MOTION_NOISE, SURVIVAL)
        undetected = gaussian_mixture.concatenate(
            [
                gaussian_mixture.predict(self._undetected, TRANSITION, MOTION_NOISE, SURVIVAL),
                self._births,
            ]
        )
        clutter, size, count = self._case.clutter_intensity, undetected.size, len(scan)
        new = phd.update(
            undetected,
            scan,
            expected=Expected.of(undetected.means @ POSITION.T, POSITION[None]),
            noise=NOISE[None],
            detection_probability=DETECTION,
            clutter_intensity=clutter,
            gate=GATE,
        )
        newcomer = np.minimum(new.measurement_weights, 1.0 - 1e-9)  # e / (κ + e)
        updated = pmb.update(
            tracks,
            scan,
            expected=Expected.of(tracks.means @ POSITION.T, _h(tracks)),
            noise=NOISE[None],
            detection_probability=np.full(tracks.size, DETECTION),
            unexplained_intensity=clutter / (1.0 - newcomer),  # κ + e
            gate=GATE,
        )
        existences = updated.marginals.unexplained * newcomer
        born = np.flatnonzero(existences > PRUNING)
        # one Gaussian a measurement; those that nobody may have made are not looked at
        place = np.full(count, -1)
        place[born] = np.arange(len(born))
        pairs = size + np.flatnonzero(place[new.measurements[size:]] >= 0)
        merged = linear_algebra.merge_moments(
            new.posterior.weights[pairs],
            new.posterior.means[pairs],
            new.posterior.covariances[pairs],
            place[new.measurements[pairs]],
            len(born),
        )
        labels = self._next_label + np.arange(len(born))
        self._next_label += len(born)
        newborns = GaussianMixture(existences[born], merged.means, merged.covariances, labels)
        tracks = gaussian_mixture.concatenate([updated.tracks, newborns])
        self._tracks = tracks.take(gaussian_mixture.prune(tracks, 100.0 * PRUNING))
        self._undetected, _ = gaussian_mixture.reduce(
            new.posterior.take(np.arange(size)),
            pruning_threshold=PRUNING,
            merging_threshold=MERGING,
            max_components=self._case.most_components,
        )

    def places(self, rule: str) -> ndarray:
        """By ``components``: the existence of each track."""
        return self._tracks.means[phd.extract(self._tracks, HALF)][:, [0, 2]]
