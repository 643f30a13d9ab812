"""Places that somebody stated among the rows of paths: measured like boxes where they agree with
these, and obeyed where they do not."""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.corrections import Correction
from tracker.corrections.stating import doubted
from tracker.smoothing.paths import Paths

ASIDE = 1.5
"""Metres a second by which somebody leaves the way that his boxes say, as fast as one walks."""

_LEAST = 1e-12
"""Share of a place's variance by which it counts as told by something else too."""


@dataclass(frozen=True, slots=True, eq=False)
class Stated:
    """K places of rows of paths."""

    rows: Int[ndarray, " K"]
    points: Float[ndarray, "K 3"]
    """z, world metres."""
    sigmas: Float[ndarray, " K"]
    """σ, metres."""
    noises: Float[ndarray, "K 3 3"]
    """R, with which each is weighed: more than σ² I where all else contradicts it, so that who is
    off his way at one step is not taken for somebody who moves wildly, or for another."""
    asides: Float[ndarray, "K 3"]
    """From where the boxes have each row to where it is said to be, metres; 0 where these agree."""

    @staticmethod
    def of(rows: Int[ndarray, " K"], said: Many[Correction]) -> Stated:
        """Places as they were said."""
        sigmas = np.array([one.accuracy or 1.0 for one in said])
        points = np.array([one.places[0].point for one in said]).reshape(-1, 3)
        noises = sigmas[:, None, None] ** 2 * np.eye(3)
        return Stated(rows, points, sigmas, noises, np.zeros_like(points))

    def information(
        self, matrices: Float[ndarray, "N 3 3"], vectors: Float[ndarray, "N 3"]
    ) -> tuple[Float[ndarray, "N 3 3"], Float[ndarray, "N 3"]]:
        """What boxes say of the rows, with the places."""
        matrices, vectors = matrices.copy(), vectors.copy()
        precisions = np.linalg.inv(self.noises)
        matrices[self.rows] += precisions
        vectors[self.rows] += np.einsum("kab,kb->ka", precisions, self.points)
        return matrices, vectors

    def _against(self, k: int, mean: ndarray, covariance: ndarray) -> tuple[ndarray, ndarray]:
        """ν from where all but the place has a row to it, and the covariance P⁻ of that.

        With m and P of everything, R − P = R (P⁻ + R)⁻¹ R and z − m = R (P⁻ + R)⁻¹ ν.
        """
        noise = self.noises[k]
        lost = noise - covariance[:3, :3] + _LEAST * np.trace(noise) * np.eye(3)
        gain = noise @ np.linalg.inv(lost)
        return gain @ (self.points[k] - mean[:3]), gain @ noise - noise

    def weighed(self, means: Float[ndarray, "N d"], covariances: Float[ndarray, "N d d"]) -> Stated:
        """Weighed by how far they contradict all else, given the rows smoothed with them."""
        noises = self.noises.copy()
        for k, row in enumerate(self.rows.tolist()):
            offset, rest = self._against(k, means[row], covariances[row])
            sigma = float(self.sigmas[k])
            noises[k] = sigma**2 * np.eye(3) + doubted(offset, rest, sigma)
        return replace(self, noises=noises)

    @property
    def contradicted(self) -> bool:
        """Whether all else contradicts any of them."""
        traces = np.trace(self.noises, axis1=1, axis2=2)
        return bool((traces > 3.0 * self.sigmas**2 * (1.0 + 1e-9)).any())

    def obeyed(
        self, states: Float[ndarray, "N d"], covariances: Float[ndarray, "N d d"]
    ) -> tuple[Stated, Float[ndarray, "N d"], Float[ndarray, "N d d"]]:
        """The rows that all else contradicts at their places, to within the σ of each: what all
        else says of somebody who is said to be elsewhere is no better than the way there is long.

        Args:
            states: Smoothed with the places as they are weighed.
            covariances: Theirs.

        Returns:
            The places with the way to them; states and covariances.
        """
        asides = np.zeros_like(self.points)
        if not self.contradicted:
            return replace(self, asides=asides), states, covariances
        states, covariances = states.copy(), covariances.copy()
        for k, row in enumerate(self.rows.tolist()):
            offset, rest = self._against(k, states[row], covariances[row])
            widened = doubted(offset, rest, float(self.sigmas[k]))
            if not widened.any():
                continue
            variance, spread = float(self.sigmas[k]) ** 2, rest + widened
            gain = np.linalg.solve(spread + variance * np.eye(3), spread).T
            asides[k] = self.points[k] - offset + gain @ offset - states[row, :3]
            states[row, :3] += asides[k]
            covariances[row, :3, :3] = variance * (gain + gain.T) / 2.0
        return replace(self, asides=asides), states, covariances

    def led_to(self, paths: Paths, step_time: float) -> Paths:
        """The paths with the ways there and back: who is somewhere else than his boxes say left
        them before and finds back to them after, as fast as one walks.

        Args:
            paths: Through the places.
            step_time: Seconds.
        """
        states, covariances = paths.states.copy(), paths.covariances.copy()
        owners, said = paths.owners, set(self.rows.tolist())
        for row, aside in zip(self.rows.tolist(), self.asides, strict=True):
            far = float(np.linalg.norm(aside))
            for turn in (-1, 1):
                near, left = row + turn, far - ASIDE * step_time
                while left > 0.0 and near not in said:
                    if not (0 <= near < len(owners) and owners[near] == owners[row]):
                        break
                    part = left / far * aside
                    states[near, :3] += part
                    covariances[near, :3, :3] += np.outer(part, part)
                    near, left = near + turn, left - ASIDE * step_time
        return paths.with_states(states, covariances)
