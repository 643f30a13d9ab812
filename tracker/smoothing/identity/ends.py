"""State estimates at the two ends of tracklets, each alone or with the rest of its chain."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.filters.models import Motion
from tracker.smoothing.paths import Paths
from tracker.smoothing.smoother import Fitted

_BEYOND = 1e-9
"""Share of the prior information that is left, so that a tracklet without boxes has about 0."""


@dataclass(frozen=True, slots=True, eq=False)
class Ends:
    """The ends of n tracklets, in the units of the state: metres and seconds."""

    ends: Float[ndarray, "n d"]
    """The last state of each tracklet, filtered from the boxes up to it."""
    covariances: Float[ndarray, "n d d"]
    """The covariance of each last state."""
    information: Float[ndarray, "n d d"]
    """Information matrix Λ on the first state of each tracklet, of the boxes from it on."""
    vectors: Float[ndarray, "n d"]
    """Information vector η of the same."""
    noise_scales: Float[ndarray, "n 2"]
    """Factor s on the process noise at the first and at the last state."""

    @staticmethod
    def alone(fitted: Fitted, prior: Float[ndarray, "d d"]) -> Ends:
        """Estimate the ends from the boxes of each tracklet alone.

        Args:
            fitted: The tracklets, each fitted to its own boxes.
            prior: Prior covariance of a first state in the fit.
        """
        tracklets = fitted.paths
        ends, begins = tracklets.starts[1:] - 1, tracklets.starts[:-1]
        inverse, origin = np.linalg.inv(tracklets.covariances[begins]), np.linalg.inv(prior)
        centre = tracklets.states[begins].copy()
        centre[:, 3:] = 0.0
        return Ends(
            tracklets.states[ends],
            tracklets.covariances[ends],
            inverse - origin,
            np.einsum("pij,pj->pi", inverse, tracklets.states[begins]) - centre @ origin,
            np.stack([fitted.noise_scales[begins], fitted.noise_scales[ends]], axis=1),
        )

    def discounted(self, share: float) -> Ends:
        """Discount the information of the boxes to a share, since errors of boxes are correlated.

        Args:
            share: Share of the information that is independent, 0 … 1.
        """
        return replace(
            self,
            covariances=self.covariances / share,
            information=self.information * share,
            vectors=self.vectors * share,
        )

    def in_chains(
        self, tracklets: Paths, chains: Fitted, rows: Int[ndarray, " M"], motion: Motion
    ) -> Ends:
        """Estimate the ends from all boxes of the chains that the tracklets are in.

        A tracklet of one step has no information about velocity; the tracklets before and after
        it have. The filtered state of a row is obtained from the prediction of the next row by
        inverting one step of the motion,

            m = F⁻¹ m⁻,   P = F⁻¹ (P⁻ − s Q) F⁻ᵀ

        Args:
            tracklets: The tracklets, with M rows.
            chains: The chains, fitted to their boxes.
            rows: The row of the chains for each of the M rows; -1 for tracklets in no chain, whose
                ends do not change.
            motion: The motion model of both.
        """
        firsts, lasts = rows[tracklets.starts[:-1]], rows[tracklets.starts[1:] - 1]
        joined = np.flatnonzero(firsts >= 0)
        first, last, paths = firsts[joined], lasts[joined], chains.paths
        ends, covariances = self.ends.copy(), self.covariances.copy()
        ends[joined], covariances[joined] = paths.states[last], paths.covariances[last]
        goes_on = ~np.isin(last, paths.starts[1:] - 1)
        after, back = last[goes_on] + 1, np.linalg.inv(motion.transition)
        added = chains.noise_scales[after, None, None] * motion.noise
        ends[joined[goes_on]] = chains.ahead[after] @ back.T
        covariances[joined[goes_on]] = back @ (chains.ahead_covariances[after] - added) @ back.T
        inverse = np.linalg.inv(paths.covariances[first])
        before = (1.0 - _BEYOND) * np.linalg.inv(chains.ahead_covariances[first])
        information, vectors = self.information.copy(), self.vectors.copy()
        information[joined] = inverse - before
        vectors[joined] = np.einsum("pij,pj->pi", inverse, paths.states[first])
        vectors[joined] -= np.einsum("pij,pj->pi", before, chains.ahead[first])
        noise_scales = self.noise_scales.copy()
        noise_scales[joined, 0] = chains.noise_scales[first]
        noise_scales[joined, 1] = chains.noise_scales[last]
        return Ends(ends, covariances, information, vectors, noise_scales)
