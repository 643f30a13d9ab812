"""Position constraints on rows of paths, from corrections.

A place is a measurement where it agrees with the boxes. Where the boxes contradict it, its noise is
inflated for the fit, and the path is led to it afterwards.
"""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.corrections import Correction
from tracker.corrections.inflation import inflation
from tracker.smoothing.paths import Paths

ASIDE = 1.5
"""Speed at which a path is led from the estimate from boxes to an enforced place: a walking pace,
metres per second."""

_LEAST = 1e-12
"""Share of a place's variance that is added to keep the matrix invertible."""


@dataclass(frozen=True, slots=True, eq=False)
class PlaceMeasurements:
    """K measured places of rows of paths."""

    rows: Int[ndarray, " K"]
    """Index of the row of each place."""
    points: Float[ndarray, "K 3"]
    """z: the place, world metres."""
    sigmas: Float[ndarray, " K"]
    """σ: standard deviation of the place along each axis, metres."""
    noises: Float[ndarray, "K 3 3"]
    """R: noise covariance of each place, more than σ² I where the boxes contradict it, so that one
    outlying place neither raises the process noise nor splits the track, squared metres."""
    asides: Float[ndarray, "K 3"]
    """Offset from the estimate of boxes to the enforced place, metres; 0 where they agree."""

    @staticmethod
    def of(rows: Int[ndarray, " K"], corrections: Many[Correction]) -> PlaceMeasurements:
        """The places of corrections, one for each row, with R = σ² I."""
        sigmas = np.array([one.accuracy or 1.0 for one in corrections])
        points = np.array([one.places[0].point for one in corrections]).reshape(-1, 3)
        noises = sigmas[:, None, None] ** 2 * np.eye(3)
        return PlaceMeasurements(rows, points, sigmas, noises, np.zeros_like(points))

    def information(
        self, matrices: Float[ndarray, "N 3 3"], vectors: Float[ndarray, "N 3"]
    ) -> tuple[Float[ndarray, "N 3 3"], Float[ndarray, "N 3"]]:
        """Add the information of the places to that of the boxes.

        Args:
            matrices: Information matrix on the position of each row.
            vectors: Information vector on the position of each row.
        """
        if not len(self.rows):
            return matrices, vectors
        matrices, vectors = matrices.copy(), vectors.copy()
        precisions = np.linalg.inv(self.noises)
        matrices[self.rows] += precisions
        vectors[self.rows] += np.einsum("kab,kb->ka", precisions, self.points)
        return matrices, vectors

    def _innovation(self, k: int, mean: ndarray, covariance: ndarray) -> tuple[ndarray, ndarray]:
        """Compute the innovation ν of place k, and the covariance P⁻ of its row without that place.

        With the smoothed m and P, which include the place, R − P = R (P⁻ + R)⁻¹ R and
        z − m = R (P⁻ + R)⁻¹ ν.
        """
        noise = self.noises[k]
        lost = noise - covariance[:3, :3] + _LEAST * np.trace(noise) * np.eye(3)
        gain = noise @ np.linalg.inv(lost)
        return gain @ (self.points[k] - mean[:3]), gain @ noise - noise

    def inflate(
        self, means: Float[ndarray, "N d"], covariances: Float[ndarray, "N d d"]
    ) -> PlaceMeasurements:
        """Inflate the noise of the places by how far they contradict the boxes.

        Args:
            means: State of each row, smoothed with the places.
            covariances: Covariance of each row.
        """
        noises = self.noises.copy()
        for k, row in enumerate(self.rows.tolist()):
            offset, rest = self._innovation(k, means[row], covariances[row])
            sigma = float(self.sigmas[k])
            noises[k] = sigma**2 * np.eye(3) + inflation(offset, rest, sigma)
        return replace(self, noises=noises)

    @property
    def contradicted(self) -> bool:
        """Whether the boxes contradict any of the places."""
        traces = np.trace(self.noises, axis1=1, axis2=2)
        return bool((traces > 3.0 * self.sigmas**2 * (1.0 + 1e-9)).any())

    def enforce(
        self, states: Float[ndarray, "N d"], covariances: Float[ndarray, "N d d"]
    ) -> tuple[PlaceMeasurements, Float[ndarray, "N d"], Float[ndarray, "N d d"]]:
        """Move the rows whose places the boxes contradict to these places, to within their σ.

        The covariance of such a row without its place is inflated to the distance of the place.

        Args:
            states: State of each row, smoothed with the places and their inflated noise.
            covariances: Covariance of each row.

        Returns:
            The places with their offsets, and the states and covariances.
        """
        asides = np.zeros_like(self.points)
        if not self.contradicted:
            return replace(self, asides=asides), states, covariances
        states, covariances = states.copy(), covariances.copy()
        for k, row in enumerate(self.rows.tolist()):
            offset, rest = self._innovation(k, states[row], covariances[row])
            widened = inflation(offset, rest, float(self.sigmas[k]))
            if not widened.any():
                continue
            variance, spread = float(self.sigmas[k]) ** 2, rest + widened
            gain = np.linalg.solve(spread + variance * np.eye(3), spread).T
            asides[k] = self.points[k] - offset + gain @ offset - states[row, :3]
            states[row, :3] += asides[k]
            covariances[row, :3, :3] = variance * (gain + gain.T) / 2.0
        return replace(self, asides=asides), states, covariances

    def lead(self, paths: Paths, step_time: float) -> Paths:
        """Lead the paths to their enforced places and back, at walking speed.

        Args:
            paths: The paths, whose rows are at the enforced places.
            step_time: Time between two steps, seconds.
        """
        states, covariances = paths.states.copy(), paths.covariances.copy()
        owners, constrained = paths.owners, set(self.rows.tolist())
        for row, aside in zip(self.rows.tolist(), self.asides, strict=True):
            far = float(np.linalg.norm(aside))
            for turn in (-1, 1):
                near, left = row + turn, far - ASIDE * step_time
                while left > 0.0 and near not in constrained:
                    if not (0 <= near < len(owners) and owners[near] == owners[row]):
                        break
                    part = left / far * aside
                    states[near, :3] += part
                    covariances[near, :3, :3] += np.outer(part, part)
                    near, left = near + turn, left - ASIDE * step_time
        return paths.with_states(states, covariances)
