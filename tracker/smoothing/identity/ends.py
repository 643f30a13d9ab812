"""What is known of pieces of tracks at their two ends: alone, or with the rest of their chains."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.filters.models import Motion
from tracker.smoothing.paths import Paths
from tracker.smoothing.smoother import Fitted

_BEYOND = 1e-9
"""Of the covariance before: what keeps information at 0 where a piece's boxes say nothing."""


@dataclass(frozen=True, slots=True, eq=False)
class Ends:
    """n pieces of tracks."""

    ends: Float[ndarray, "n d"]
    """The last state of each, by what is up to it."""
    covariances: Float[ndarray, "n d d"]
    information: Float[ndarray, "n d d"]
    """Λ of what is from its beginning on, of the first state of each."""
    vectors: Float[ndarray, "n d"]
    """η."""
    restlessness: Float[ndarray, "n 2"]
    """s at the beginning and at the end."""

    @staticmethod
    def alone(fitted: Fitted, prior: Float[ndarray, "d d"]) -> Ends:
        """By the boxes of each piece alone.

        Args:
            fitted: The pieces, each fitted to its own boxes.
            prior: Covariance of a first state in the fit.
        """
        pieces = fitted.paths
        ends, begins = pieces.starts[1:] - 1, pieces.starts[:-1]
        inverse, origin = np.linalg.inv(pieces.covariances[begins]), np.linalg.inv(prior)
        centre = pieces.states[begins].copy()
        centre[:, 3:] = 0.0
        return Ends(
            pieces.states[ends],
            pieces.covariances[ends],
            inverse - origin,
            np.einsum("pij,pj->pi", inverse, pieces.states[begins]) - centre @ origin,
            np.stack([fitted.restlessness[begins], fitted.restlessness[ends]], axis=1),
        )

    def told_by(self, share: float) -> Ends:
        """Where boxes err alike for a while, only a share of what they say is new: it is as little
        known where a piece ends, and where and how fast the next one begins."""
        return replace(
            self,
            covariances=self.covariances / share,
            information=self.information * share,
            vectors=self.vectors * share,
        )

    def in_chains(
        self, pieces: Paths, chains: Fitted, rows: Int[ndarray, " M"], motion: Motion
    ) -> Ends:
        """By all boxes of the chains of several pieces.

        A piece of one step says nothing of where its person goes; the pieces before and after
        it do. What is known before the next row is undone by one step of the motion,

            m = F⁻¹ m⁻,   P = F⁻¹ (P⁻ − s Q) F⁻ᵀ

        Args:
            pieces: The pieces.
            chains: Fitted to their boxes.
            rows: Of the chains, for each row of the pieces; -1 for pieces in no such chain,
                which stay as they are.
            motion: Of both.
        """
        firsts, lasts = rows[pieces.starts[:-1]], rows[pieces.starts[1:] - 1]
        joined = np.flatnonzero(firsts >= 0)
        first, last, paths = firsts[joined], lasts[joined], chains.paths
        ends, covariances = self.ends.copy(), self.covariances.copy()
        ends[joined], covariances[joined] = paths.states[last], paths.covariances[last]
        goes_on = ~np.isin(last, paths.starts[1:] - 1)
        after, back = last[goes_on] + 1, np.linalg.inv(motion.transition)
        added = chains.restlessness[after, None, None] * motion.noise
        ends[joined[goes_on]] = chains.ahead[after] @ back.T
        covariances[joined[goes_on]] = back @ (chains.ahead_covariances[after] - added) @ back.T
        inverse = np.linalg.inv(paths.covariances[first])
        before = (1.0 - _BEYOND) * np.linalg.inv(chains.ahead_covariances[first])
        information, vectors = self.information.copy(), self.vectors.copy()
        information[joined] = inverse - before
        vectors[joined] = np.einsum("pij,pj->pi", inverse, paths.states[first])
        vectors[joined] -= np.einsum("pij,pj->pi", before, chains.ahead[first])
        restlessness = self.restlessness.copy()
        restlessness[joined, 0] = chains.restlessness[first]
        restlessness[joined, 1] = chains.restlessness[last]
        return Ends(ends, covariances, information, vectors, restlessness)
