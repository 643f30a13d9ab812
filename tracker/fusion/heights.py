"""Heights at which a target can be, as a prior of tracks that boxes leave uncertain.

[SS10] D. Simon, D. L. Simon, "Constrained Kalman filtering via density function truncation for
turbofan engine health estimation", International Journal of Systems Science 41(2), 2010.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.sequences.sequence import Room

_HEIGHT = 2
"""Index of the height in the state."""

_NEAR = 1.0
"""Distance from a bound, in standard deviations, from which on a track is truncated. A Gaussian is
not zero beyond the bound after a truncation; truncated at every step, a track well inside would
move away from the bound although nothing new is known of it."""


@dataclass(frozen=True, slots=True)
class HeightBounds:
    """Bounds of a target's centre: at the lower one it lies or crouches on the floor.

    One camera measures a target's distance by the size of its box alone, and boxes that are all
    a little too small put it below the floor. With two cameras the rays meet, and the bounds have
    no effect.
    """

    low: float
    """Height of a centre on the floor, world metres."""
    high: float
    """Height of a centre as far below the ceiling as ``low`` is above the floor, world metres."""
    outside: float
    """Density beyond the bounds relative to that between them, 0 … 1."""

    @staticmethod
    def of(room: Room, half_height: float, outside: float) -> HeightBounds:
        """The bounds in a room.

        Args:
            room: The room, from floor to ceiling.
            half_height: Half height of a target on the floor, metres.
            outside: Density beyond the bounds relative to that between them, 0 … 1.
        """
        low = float(room.minimum[_HEIGHT]) + half_height
        return HeightBounds(low, max(low, float(room.maximum[_HEIGHT]) - half_height), outside)

    def truncate(self, tracks: GaussianMixture) -> GaussianMixture:
        """Truncate the tracks whose height is near or beyond a bound ([SS10]_).

        With a = (low − z) / σ and b = (high − z) / σ, the density φ of the standard normal, its
        distribution Φ, and the weight ε outside, the moments of (1 − ε) φ on [a, b] and ε φ
        everywhere are

            m_0 = (1 − ε) (Φ(b) − Φ(a)) + ε
            m_1 = (1 − ε) (φ(a) − φ(b))
            m_2 = (1 − ε) (Φ(b) − Φ(a) + a φ(a) − b φ(b)) + ε

        The rest of the state follows by regression on the height: with the gain g = P_z / σ the
        mean moves by g m_1/m_0, and P becomes P − g gᵀ (1 − m_2/m_0 + (m_1/m_0)²).

        Args:
            tracks: J tracks, positions in world metres.

        Returns:
            The same tracks; those well between the bounds are not changed.
        """
        heights = tracks.means[:, _HEIGHT]
        sigmas = np.sqrt(tracks.covariances[:, _HEIGHT, _HEIGHT])
        margins = np.minimum(heights - self.low, self.high - heights)
        rows = np.flatnonzero((margins < _NEAR * sigmas) & (sigmas > 0.0))
        if not len(rows):
            return tracks
        z, sigma = heights[rows], sigmas[rows]
        moves, shares = self._moments((self.low - z) / sigma, (self.high - z) / sigma)
        gains = tracks.covariances[rows][:, :, _HEIGHT] / sigma[:, None]
        means, covariances = tracks.means.copy(), tracks.covariances.copy()
        means[rows] += gains * moves[:, None]
        lost = gains[:, :, None] * gains[:, None, :]
        covariances[rows] -= lost * (1.0 - shares)[:, None, None]
        return replace(tracks, means=means, covariances=covariances)

    def _moments(
        self, a: Float[ndarray, " K"], b: Float[ndarray, " K"]
    ) -> tuple[Float[ndarray, " K"], Float[ndarray, " K"]]:
        """Mean and variance of the weighted standard normal, bounds in standard deviations."""
        from scipy.special import ndtr  # a server starts without it

        rest = 1.0 - self.outside
        at_a, at_b = (np.exp(-0.5 * x**2) / np.sqrt(2.0 * np.pi) for x in (a, b))
        between = ndtr(b) - ndtr(a)
        weight = rest * between + self.outside
        # with no density outside, one that has none between either stays as it is
        there = weight > _LEAST
        weight = np.where(there, weight, 1.0)
        mean = rest * (at_a - at_b) / weight
        second = (rest * (between + a * at_a - b * at_b) + self.outside) / weight
        variance = np.maximum(second - mean**2, _LEAST)
        return np.where(there, mean, 0.0), np.where(there, variance, 1.0)


_LEAST = 1e-6
"""Probability, and variance relative to σ², below which rounding would decide."""
